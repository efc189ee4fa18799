"""Which substeps are stable for a vehicle, against a drive with them and against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import SpecError
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import names
from autodrive.scenario.vehicles import stability
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.scenario.vehicles.stability import is_stable
from tests.support.cars import car_file


def unrest(vehicle: str, substep: float) -> float:
    """Largest speed [m/s] in the last of six seconds after a small push."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, tick=substep, substep=substep))
    state = world.compiled.state
    state.qvel[2:4] = 0.002
    speeds = []
    for _ in range(round(6.0 / substep)):
        world.step()
        speeds.append(float(np.abs(state.qvel).max()))
    return max(speeds[-round(1.0 / substep) :])


@pytest.mark.parametrize("vehicle", names("vehicle"))
def test_a_vehicle_comes_to_rest_with_stable_substeps_only(vehicle: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = load_vehicle(vehicle)
    limit = max(dt for dt in np.arange(0.0005, 0.005, 1e-5).tolist() if is_stable(spec, dt))
    assert unrest(vehicle, round(0.95 * limit, 5)) < 1e-9
    if limit < 0.0045:  # that of the softer cars is longer than the longest substep of a scenario
        monkeypatch.setattr(stability, "TOLERANCE", math.inf)
        assert unrest(vehicle, round(1.1 * limit, 5)) > 1e-3


def test_the_limit_of_springs_alone_is_the_closed_form() -> None:
    spec = load_vehicle("nigel_2023")
    regular = spec.wheels.regularisation.model_copy(update={"hold_frequency": 0.01})
    suspension = spec.wheels.suspension.model_copy(update={"look_ahead": 0.0})
    body = spec.body.model_copy(update={"center_of_mass": (spec.wheelbase / 2, 0.0, 0.04)})
    wheels = spec.wheels.model_copy(update={"suspension": suspension, "regularisation": regular})
    spec = spec.model_copy(update={"wheels": wheels, "body": body})
    inverse = max(4 / body.mass, 4 * (spec.track / 2) ** 2 / body.inertia[0])  # heave, roll
    limit = 2.0 / math.sqrt(suspension.stiffness * inverse)
    assert is_stable(spec, 0.999 * limit)
    assert not is_stable(spec, 1.001 * limit)


def test_an_unstable_substep_is_refused_with_the_longest_good_one() -> None:
    spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(type="nigel_2023"), "V2": VehiclePlacement(x=1.0)})
    with pytest.raises(SpecError, match=r"V1: .*'nigel_2023' are unstable .* 0\.005 s; .* at most 0\.0025") as error:
        autodrive.make(spec.model_copy(update={"substep": 0.005}))
    assert len(error.value.errors) == 1
    autodrive.make(spec.model_copy(update={"substep": 0.0025}))


def test_dampers_too_stiff_for_any_substep_are_refused_with_the_greatest_good_damping(tmp_path: Path) -> None:
    """Jury's criterion with dampers far stiffer than the springs: 2 b dt < 4, with b = 4 damping / mass for heave."""

    def car(damping: float) -> ScenarioSpec:
        soft = {"wheels.regularisation.hold_frequency": 0.01}
        file = car_file(tmp_path, {"wheels.suspension.damping": damping} | soft)
        return ScenarioSpec(vehicles={"V1": VehiclePlacement(type=file)})

    with pytest.raises(SpecError, match=r"no substep of a .* short enough; set 'wheels\.suspension\.damping'") as error:
        autodrive.make(car(1e7))
    damping = float(str(error.value).split("at most ")[1].split()[0])
    spec = load_vehicle("nigel")
    heave, roll = 4 / spec.body.mass, 4 * (spec.track / 2) ** 2 / spec.body.inertia[0]
    assert damping == pytest.approx(2.0 / (0.001 * max(heave, roll)), rel=0.02)  # two digits
    autodrive.make(car(damping))
    with pytest.raises(SpecError, match="set 'substep' to at most"):
        autodrive.make(car(1.1 * damping))


def test_springs_too_stiff_for_any_substep_are_named(tmp_path: Path) -> None:
    file = car_file(tmp_path, {"wheels.suspension.stiffness": 1e9, "body.inertia": [1e-6, 1e-6, 1e-6]})
    with pytest.raises(SpecError, match="no substep of a scenario is short enough; its springs are too stiff"):
        autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=file)}))
