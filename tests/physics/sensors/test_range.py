"""The range sensor against closed-form distances, its data sheet figures, REP 117, and through the native protocol."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive.physics.model import BOX, CYLINDER
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.range import RangeSpec, directions
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.codec import decode_server, encode, streamed
from autodrive.protocol.messages import Frame, RangeReading
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from tests.support.cars import car_file
from tests.support.one_sensor import OneSensor
from tests.support.sensor_scenes import Solid, scene

HEIGHT = 0.1
MOUNT = Mount(position=(0.0, 0.0, HEIGHT))


def measured(solids: list[Solid], **spec: Any) -> float:
    fields: dict[str, Any] = {"mount": MOUNT} | spec
    return OneSensor(RangeSpec(**fields), scene(solids)).sample().range


def wall(distance: float, height: float = 10.0) -> Solid:
    """A wall perpendicular to the axis; its near face is at that distance."""
    return Solid(BOX, (0.05, 10.0, height), (distance + 0.05, 0.0, 0.0))


def test_distance_to_a_perpendicular_wall_is_that_of_its_plane() -> None:
    assert measured([wall(1.25)]) == pytest.approx(1.25, abs=1e-12)


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, -50.0])
def test_distance_to_an_oblique_wall_is_that_at_the_edge_of_the_cone(turn_deg: float) -> None:
    fov, distance = 15.0, 1.0
    mount = Mount(position=(0.0, 0.0, HEIGHT), rotation_deg=(0.0, 0.0, turn_deg))
    # a ray hits the plane x = d at d / cos(angle); the smallest angle in the cone counts
    nearest = max(abs(turn_deg) - fov / 2, 0.0)
    expected = distance / math.cos(math.radians(nearest))
    assert measured([wall(distance)], mount=mount, field_of_view_deg=fov) == pytest.approx(expected, rel=1e-12)


def test_a_cylinder_beside_the_axis_is_detected_only_within_the_cone() -> None:
    bearing = math.radians(10.0)
    post = Solid(CYLINDER, (0.01, 1.0), (math.cos(bearing), math.sin(bearing), 0.0))
    assert measured([post], field_of_view_deg=15.0) == math.inf
    # the ring at 10 degrees of a cone of 20 has a ray in its plane
    assert measured([post], field_of_view_deg=20.0) == pytest.approx(0.99, abs=1e-12)


def test_the_nearest_solid_counts_and_the_own_vehicle_is_ignored() -> None:
    own = Solid(BOX, (0.1, 0.1, 0.1), (0.5, 0.0, HEIGHT), vehicle=0)
    assert measured([wall(2.0), own, wall(1.0), wall(3.0)]) == pytest.approx(1.0, abs=1e-12)


def test_the_rays_lie_in_the_cone_and_reach_its_edge() -> None:
    rays = directions(math.radians(30.0), rings=3)
    angles = np.arccos(np.clip(rays[:, 0], -1.0, 1.0))
    assert len(rays) == 1 + 8 + 16 + 24
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1.0)
    assert angles.max() == pytest.approx(math.radians(15.0))


def test_the_ground_is_detected_only_if_configured() -> None:
    assert measured([]) == math.inf
    # the lowest ray of the cone hits the floor at height / sin(half of the field of view)
    expected = HEIGHT / math.sin(math.radians(7.5))
    assert measured([], sees_ground=True) == pytest.approx(expected, rel=1e-12)


def test_out_of_range_is_infinite_as_in_rep_117() -> None:
    limits: dict[str, Any] = {"range_min": 0.2, "range_max": 2.0}
    assert measured([wall(0.1)], **limits) == -math.inf
    assert measured([wall(0.2)], **limits) == pytest.approx(0.2)
    assert measured([wall(1.999)], **limits) == pytest.approx(1.999)
    assert measured([wall(2.1)], **limits) == math.inf
    assert measured([], **limits) == math.inf
    assert measured([Solid(BOX, (0.5, 0.5, 0.5), (0.0, 0.0, HEIGHT))], **limits) == -math.inf  # inside the box


def test_noise_has_the_statistics_of_the_spec() -> None:
    sensor = OneSensor(RangeSpec(mount=MOUNT, rings=0, noise=NoiseSpec(sigma=0.01, step=0.001)), scene([wall(1.0)]))
    values = np.array([sensor.sample().range for _ in range(4000)])
    # four standard errors: sigma / sqrt(n) and sigma / sqrt(2 n); the step adds step^2 / 12 to the variance
    assert values.mean() == pytest.approx(1.0, abs=4 * 0.01 / math.sqrt(4000))
    assert values.std() == pytest.approx(math.hypot(0.01, 0.001 / math.sqrt(12)), rel=4 / math.sqrt(8000))
    assert values / 0.001 == pytest.approx(np.round(values / 0.001), abs=1e-6)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    """0.5 s of a vehicle with the sensor at its front and a box ahead, through the codec of the native protocol."""
    sensor = {"mount": {"position": [0.2, 0.0, HEIGHT]}, "rate": 20.0, "range_max": 2.0}
    car = car_file(tmp_path_factory.mktemp("car"), {"sensors.range": sensor})
    world = autodrive.make(
        ScenarioSpec(
            vehicles={"V1": VehiclePlacement(type=car), "V2": VehiclePlacement(y=3.0)},
            boxes={"box": BoxSpec(x=1.0, y=0.0, size=(0.2, 0.4, 0.4))},
        )
    )
    received = []
    for _ in range(50):
        message = decode_server(encode(streamed(world.step(), ())))
        assert isinstance(message, Frame)
        received.append(message)
    return received


def test_a_reading_is_unchanged_by_the_native_protocol(frames: list[Frame]) -> None:
    reading = frames[-1].vehicles["V1"].range
    assert reading is not None
    # the near face is at 0.9; the height of the sensor changes with the suspension, but not the distance to the face
    distance: Any = pytest.approx(0.7, abs=1e-6)
    assert reading == RangeReading(0.5, distance, math.radians(15.0), 0.02, 2.0, "ultrasound")


def test_a_vehicle_has_no_range_sensor_by_default(frames: list[Frame]) -> None:
    assert frames[-1].vehicles["V2"].range is None


def test_samples_have_the_rate_of_the_spec(frames: list[Frame]) -> None:
    times = sorted({reading.time for frame in frames if (reading := frame.vehicles["V1"].range) is not None})
    assert times == pytest.approx(np.arange(0.0, 0.51, 0.05))


def test_the_sensor_measures_along_the_x_axis_of_its_mount(tmp_path: Path) -> None:
    backwards = {"mount": {"position": [-0.1, 0.0, HEIGHT], "rotation_deg": [0.0, 0.0, 180.0]}}
    car = car_file(tmp_path, {"sensors.range": backwards})
    spec = ScenarioSpec(
        vehicles={"V1": VehiclePlacement(type=car)}, boxes={"box": BoxSpec(x=-1.0, y=0.0, size=(0.2, 0.4, 0.4))}
    )
    reading = autodrive.make(spec).frame.vehicles["V1"].range
    assert reading is not None
    assert reading.range == pytest.approx(0.8, abs=1e-6)
