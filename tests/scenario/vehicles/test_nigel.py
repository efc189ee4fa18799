"""nigel.yaml against the tables of the report."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.errors import SpecError
from autodrive.base.yaml_files import parse
from autodrive.scenario.vehicles.parameters import effective_masses, sprung_masses
from autodrive.scenario.vehicles.spec import FrictionCurve, VehicleSpec, load_vehicle

NIGEL = load_vehicle("nigel")


def test_table_1_design_summary() -> None:
    assert NIGEL.size == (0.300, 0.175, 0.182)
    assert NIGEL.body.mass == 1.75
    assert NIGEL.drivetrain.speed_limit_rpm == 130.0
    assert NIGEL.summary["steering actuator"] == "SG90"
    assert len(NIGEL.platforms) == 4
    assert all(platform.size[2] == 0.003 for platform in NIGEL.platforms)


def test_platforms_have_the_length_of_the_car() -> None:
    front = max(box.position[0] + box.size[0] / 2 for box in NIGEL.platforms)
    back = min(box.position[0] - box.size[0] / 2 for box in NIGEL.platforms)
    assert front - back == pytest.approx(NIGEL.size[0])
    assert NIGEL.track + NIGEL.wheels.width == pytest.approx(NIGEL.size[1])


def test_tables_4_to_8_sensors() -> None:
    sensors = NIGEL.sensors
    assert sensors.encoders.pulses_per_revolution == 16
    lidar = sensors.lidar
    assert lidar is not None
    assert (lidar.rate, lidar.rays, lidar.range_min, lidar.range_max, lidar.intensity) == (7.0, 360, 0.15, 12.0, 47.0)
    for camera in NIGEL.cameras.values():
        assert (camera.width, camera.height, camera.field_of_view_deg) == (640, 480, 41.669)
        assert (camera.focal_length, camera.sensor_size) == (0.0036, (0.00376, 0.00274))


def test_field_of_view_of_table_8_is_the_vertical_one() -> None:
    camera = NIGEL.cameras["front"]
    assert camera.sensor_size is not None
    assert camera.focal_length is not None
    vertical = 2 * math.degrees(math.atan(camera.sensor_size[1] / 2 / camera.focal_length))
    assert vertical == pytest.approx(camera.field_of_view_deg, abs=0.001)  # the table's last digit


def test_table_9_system_parameters() -> None:
    car = load_vehicle("nigel_2020")
    body, wheels = car.body, car.wheels
    assert (body.mass, body.drag, body.angular_drag) == (1.75, 0.1, 0.05)
    assert (wheels.mass, wheels.radius, wheels.damping_rate, wheels.force_height) == (0.034, 0.0325, 0.025, 0.0)
    suspension = wheels.suspension
    assert (suspension.distance, suspension.stiffness, suspension.damping) == (0.01, 5040.0, 20.0)
    assert suspension.target_position == 0.5
    assert suspension.droop_max == 0.005
    assert wheels.forward_friction is not None
    assert wheels.sideways_friction is not None
    assert wheels.forward_friction.numbers[:4] == (0.4, 1.0, 0.8, 0.5)
    assert wheels.sideways_friction.numbers[:4] == (0.2, 1.0, 0.5, 0.75)
    assert car.steering.limit_deg == 30.0


def test_only_the_damping_of_its_wheels_distinguishes_nigel_from_table_9() -> None:
    table_9 = load_vehicle("nigel_2020")
    wheels = table_9.wheels.model_copy(update={"damping_rate": 2.5e-5})
    assert table_9.model_copy(update={"title": NIGEL.title, "wheels": wheels}) == NIGEL


def test_inertia_is_that_of_a_box_of_the_cars_size() -> None:
    a, b, c = np.square(NIGEL.size)
    expected = NIGEL.body.mass / 12 * np.array([b + c, a + c, a + b])
    assert NIGEL.body.inertia == pytest.approx(expected, rel=1e-4)  # written with four digits


@given(st.floats(0.05, 5.0), st.floats(0.05, 5.0), st.floats(0.0, 1.0), st.floats(-0.5, 0.5))
def test_sprung_masses_are_the_least_squares_solution(length: float, track: float, ahead: float, aside: float) -> None:
    centre = (ahead * length, aside * track, 0.1)
    body = NIGEL.body.model_copy(update={"center_of_mass": centre})
    spec = NIGEL.model_copy(update={"wheelbase": length, "track": track, "body": body})
    hubs = np.array(spec.hubs)
    balance = np.stack([np.ones(4), hubs[:, 0], hubs[:, 1]])
    solution = np.linalg.lstsq(balance, body.mass * np.array([1.0, *centre[:2]]), rcond=None)[0]
    assert sprung_masses(spec) == pytest.approx(solution, abs=1e-12)  # relative to a mass of 1.75 kg


def test_effective_mass_is_that_of_a_force_on_a_free_body() -> None:
    body = NIGEL.body
    r = np.array(NIGEL.hubs) - [0.0, 0.0, NIGEL.wheels.radius] - np.array(body.center_of_mass)
    arms = [np.cross(r, direction) for direction in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])]
    inverse = [1.0 / body.mass + np.sum(arm**2 / np.array(body.inertia), axis=1) for arm in arms]
    assert effective_masses(NIGEL) == pytest.approx(0.25 / np.max(inverse, axis=0), rel=1e-12)


def test_all_errors_of_a_vehicle_file_are_reported_with_their_locations() -> None:
    with pytest.raises(SpecError) as caught:
        parse("title: x\nbody: {mass: -1}\nweels: {}\n", VehicleSpec, where="car.yaml")
    text = str(caught.value)
    assert "body.mass" in text
    assert "Did you mean 'wheels'?" in text
    assert "car.yaml" in text
    assert len(caught.value.errors) > 5  # and the required keys


def test_asymptote_before_the_extremum_is_refused() -> None:
    with pytest.raises(SpecError, match="asymptote_slip"):
        parse(
            "{extremum_slip: 0.4, extremum_value: 1, asymptote_slip: 0.2, asymptote_value: 1, stiffness: 1, "
            "initial_slope: 1}",
            FrictionCurve,
        )
