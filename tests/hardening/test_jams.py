"""Cars that jam, crash and tumble: no contact gives energy to anything.

AUTODRIVE_HARDENING=long runs 1,000 jams instead of 10, 1,000 cars in corners instead of 5, and 500 cars that tumble
instead of 15. The tables of the jams are printed (pytest -s).
"""

import math
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.base.transforms import quaternion_from_euler
from autodrive.physics.tick import place
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from tests.support.hardening import cases
from tests.support.jams import CORNERS, PATIENCE, SUBSTEP, TYPES, CornerJam, Energy, Jam, corner_jam, jam

GAIN = 0.02
"""Share of the kinetic energy: the integration of springs and contacts has errors of first order in the substep."""
CRASH_DEPTH, PUSH_DEPTH = 0.004, 0.002
"""Largest depths of a car in a wall [m]: in a step of the engine solids come at most 1 mm closer; the last quarter of a
second of pushing can begin with an impact."""


def test_three_cars_that_jam_throw_none() -> None:
    """The platform of one car was lifted onto a wheel of another, which took it for the ground below itself."""
    world = autodrive.make(
        ScenarioSpec(
            vehicles={
                "V1": VehiclePlacement(),
                "V2": VehiclePlacement(x=-0.59, y=0.09, yaw_deg=343.74),
                "V3": VehiclePlacement(x=0.59, y=0.11, yaw_deg=174.48),
            }
        )
    )
    commands = {name: Command(throttle=1.0, steering=s) for name, s in (("V1", 0.0), ("V2", 0.1), ("V3", 0.1))}
    for _ in range(1000):
        for name, car in world.step(commands).vehicles.items():
            assert np.linalg.norm(car.velocity) < 0.5, name  # their top speed is 0.44 m/s
            assert car.wheels.normal_load.max() < 40.0, name  # 4.3 N at rest


@pytest.mark.parametrize("vehicle", TYPES)
def test_no_car_gains_energy_from_a_contact(vehicle: str, tmp_path: Path) -> None:
    results = {seed: jam(vehicle, seed, tmp_path) for seed in cases((0, 46), range(200))}
    worst = {field: max(getattr(one, field) for one in results.values()) for field in Jam._fields}
    gains = [seed for seed, one in results.items() if one.gain > GAIN or one.excess > 1.0 + GAIN]
    print(
        f"\n{vehicle:18} {len(results):4} jams, {len(gains)} with a gain; at most: "
        + ", ".join(f"{field} {value:.4g}" for field, value in worst.items())
    )
    assert not gains


@pytest.mark.filterwarnings("ignore:.*is outside the walls of map")
@pytest.mark.parametrize("vehicle", TYPES)
def test_a_car_drives_into_a_corner_and_out_again(vehicle: str, tmp_path: Path) -> None:
    first = TYPES.index(vehicle)  # the short form has each kind of corner once
    results = {seed: corner_jam(vehicle, seed, tmp_path) for seed in cases(range(first, first + 1), range(200))}
    for kind in range(len(CORNERS)):
        own = [jammed for seed, jammed in results.items() if seed % len(CORNERS) == kind]
        if own:
            most = CornerJam(*map(max, zip(*own, strict=True)))
            figures = ", ".join(f"{field} {value:.3g}" for field, value in most._asdict().items())
            print(f"\n{vehicle:18} {CORNERS[kind]:6} {len(own):3}: {figures}")
    for seed, jammed in results.items():
        assert jammed.gain < GAIN, seed
        assert jammed.excess < 1.0 + GAIN, seed
        assert jammed.crash_depth < CRASH_DEPTH, seed
        assert jammed.push_depth < PUSH_DEPTH, seed
        assert jammed.rise < 0.3, seed  # the height of the walls
    # friction can hold a car between two sides, as it holds a wedge
    held = [seed for seed, jammed in results.items() if jammed.time_to_free > PATIENCE]
    assert len(held) <= 0.05 * len(results), held


@pytest.mark.parametrize("vehicle", TYPES)
def test_a_car_that_tumbles_gains_no_energy(vehicle: str) -> None:
    """From flight to flight: it lands on wheels, rims, corners of the chassis."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, tick=SUBSTEP))
    c = world.compiled
    qpos, dof = int(c.model.vehicles[0]["qpos"]), int(c.model.vehicles[0]["dof"])
    flights = 0
    for seed in range(cases(3, 100)):
        rng = np.random.default_rng(seed)
        world.reset()
        c.state.qpos[qpos : qpos + 3] = 0.0, 0.0, rng.uniform(0.4, 0.6)
        c.state.qpos[qpos + 3 : qpos + 7] = quaternion_from_euler(*rng.uniform(-math.pi, math.pi, 3).tolist())
        c.state.qvel[dof : dof + 6] = rng.normal(0.0, np.repeat([1.5, 4.0], 3))
        place(c.model, c.state, c.views)
        energy = Energy(world)
        least = start = energy.now()[1]
        for _ in range(1000):
            world.step()
            energy.observe_substep()
            if c.state.wheel_normal_load.any() or c.views.contact_count[0]:
                continue
            flights += 1
            flying = energy.now()[1]
            assert flying - least < GAIN * start, seed
            least = min(least, flying)
    assert flights > 300
