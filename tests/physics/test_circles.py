"""The circles at full lock that the documents state, driven: fitted to the path of the rear axle."""

import math
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import names
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.cars import IDENTIFIED, car_file, top_tread_speed
from tests.support.tables import cells

DOCS = Path(__file__).parents[2] / "docs"
VEHICLE_PAGE, RACE_CAR_PAGE = ((DOCS / name).read_text(encoding="utf-8") for name in ("vehicle.md", "race_car.md"))
VEHICLES = cells(VEHICLE_PAGE, "| vehicle | car | full speed |")
RACE_CARS = cells(RACE_CAR_PAGE, "| vehicle | car | top speed |")
DAMPING = cells(VEHICLE_PAGE, "| `damping_rate` [N m s/rad] |")

ROUNDED = 0.00055
"""Of a figure with three decimals [m]."""


def metres(texts: list[str]) -> list[float]:
    return [float(text.removesuffix(" m")) for text in texts]


def full_lock_circle(vehicle: str, throttle: float) -> tuple[float, float]:
    """Radius [m] and speed over the ground [m/s] in the second half of 12 s; the circle is that of least squares."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}))
    path = []
    for _ in range(1200):
        path.append(world.step({"V1": Command(throttle, 1.0)}).vehicles["V1"].pose.position[:2])
    points = np.array(path[600:])
    # x^2 + y^2 = 2 a x + 2 b y + c, with the radius sqrt(c + a^2 + b^2)
    a, b, c = np.linalg.lstsq(np.c_[2.0 * points, np.ones(600)], np.sum(points**2, axis=1), rcond=None)[0]
    return math.sqrt(c + a * a + b * b), float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) / 5.99


def full_lock_circle_at(vehicle: str, speed: float) -> float:
    """Radius [m] at that speed over the ground [m/s]."""
    throttle = speed / top_tread_speed(vehicle)
    for _ in range(10):
        radius, driven = full_lock_circle(vehicle, throttle)
        if driven == pytest.approx(speed, rel=0.002):
            return radius
        throttle *= speed / driven
    raise AssertionError(f"no throttle drives {speed} m/s")


def circles(vehicle: str) -> tuple[float, float]:
    """Radius at full lock [m], slowly, and at 2 m/s (neoracer: 1.5 m/s) or, if it is slower, with full throttle."""
    if top_tread_speed(vehicle) > 5.0:
        return full_lock_circle_at(vehicle, 0.5), full_lock_circle_at(vehicle, 1.5 if vehicle == "neoracer" else 2.0)
    return full_lock_circle(vehicle, 0.1)[0], full_lock_circle(vehicle, 1.0)[0]


@pytest.mark.parametrize("vehicle", sorted({*names("vehicle")} - {*IDENTIFIED}))
def test_the_circle_of_each_vehicle_is_that_of_the_documents(vehicle: str) -> None:
    radii = circles(vehicle)
    stated = next(row for name, row in VEHICLES.items() if f"`{vehicle}`" in name)
    assert metres(stated[-2:]) == pytest.approx(radii, abs=ROUNDED)
    assert stated[2] == f"{load_vehicle(vehicle).steering.limit_deg:.0f} degrees"
    if f"`{vehicle}`" in RACE_CARS:
        assert RACE_CARS[f"`{vehicle}`"][-2:] == stated[-2:]


@pytest.mark.parametrize("row", DAMPING)
def test_the_circles_with_other_dampings_of_the_wheels_are_those_of_the_document(row: str, tmp_path: Path) -> None:
    car = car_file(tmp_path, {"wheels.damping_rate": float(row.split(maxsplit=1)[0])})
    radii = full_lock_circle(car, 0.1)[0], full_lock_circle(car, 1.0)[0]
    assert metres(DAMPING[row][-2:]) == pytest.approx(radii, abs=ROUNDED)


def test_other_circles_are_those_of_the_documents(tmp_path: Path) -> None:
    slowly = full_lock_circle("nigel", 0.1)[0]
    wheelbase = load_vehicle("nigel").wheelbase
    assert "**0.2464 m** rear, 0.2842 m front" in VEHICLE_PAGE
    assert (slowly, math.hypot(slowly, wheelbase)) == pytest.approx((0.2464, 0.2842), abs=0.0001)
    assert "| the same at full speed | 0.2513 m |" in VEHICLE_PAGE
    assert full_lock_circle("nigel", 1.0)[0] == pytest.approx(0.2513, abs=0.00005)
    assert "full lock is 0.253 m" in " ".join(VEHICLE_PAGE.split())
    car = car_file(tmp_path, {"wheels.sideways_friction.initial_slope": 0.8})
    assert full_lock_circle(car, 1.0)[0] == pytest.approx(0.253, abs=ROUNDED)


@pytest.mark.parametrize(
    ("vehicle", "kinematic", "stated"), [("roboracer_f1tenth", 0.742, 0.744), ("roboracer_physical", 0.561, 0.562)]
)
def test_without_a_shaft_between_the_axles_the_circle_is_that_of_the_bicycle(
    vehicle: str, kinematic: float, stated: float, tmp_path: Path
) -> None:
    spec = load_vehicle(vehicle)
    assert spec.wheelbase / math.tan(spec.steering.limit) == pytest.approx(kinematic, abs=ROUNDED)
    car = car_file(tmp_path, {"drivetrain.differentials": {"centre": {"kind": "open"}}}, vehicle)
    assert full_lock_circle(car, 0.5 / top_tread_speed(vehicle))[0] == pytest.approx(stated, abs=ROUNDED)
    assert f"{kinematic} m" in RACE_CAR_PAGE
    assert f"{stated} m" in RACE_CAR_PAGE
