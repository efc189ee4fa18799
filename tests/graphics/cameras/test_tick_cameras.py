"""Images drawn in the tick: when they are due, of exactly the state of their Frame, the same bytes in each run."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive.graphics.render.gl import PACKAGES
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import Command, Frame, Headlights
from autodrive.scenario import ScenarioSpec
from autodrive.world import World
from tests.support.cars import car_file
from tests.support.frames import bytes_of, digests

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def shared_world(gl: str, scenario: ScenarioSpec) -> World:
    return autodrive.make(scenario, cameras=True)


@pytest.fixture(scope="module")
def other_world(gl: str, scenario: ScenarioSpec) -> World:
    """Another world of the same scenario, with a renderer of its own."""
    return autodrive.make(scenario, cameras=True)


def drive(frame: Frame) -> dict[str, Command]:
    lamps = Headlights(frame.tick // 5 % 3)
    return {"V1": Command(throttle=0.5, steering=math.sin(0.2 * frame.tick), headlights=lamps)}


def pixels(world: World, vehicle: str = "V1", camera: str = "front") -> bytes:
    return world.frame.vehicles[vehicle].cameras[camera].rgba.tobytes()


def test_the_first_frame_has_every_image(world: World) -> None:
    for vehicle in world.frame.vehicles.values():
        assert list(vehicle.cameras) == ["front", "rear"]
        for image in vehicle.cameras.values():
            assert image.time == 0.0
            assert image.rgba.shape == (72, 96, 4)
            assert (image.rgba[..., 3] == 255).all()
            assert image.rgb.std() > 5.0  # something is visible


def test_images_are_captured_at_their_rate_and_show_the_state_of_that_frame(world: World) -> None:
    """Until the next one is due, a Frame has the last image. Its pose is that of the mount on the vehicle then."""
    offset = np.linalg.norm(world.vehicle_specs["V1"].cameras["front"].mount.position)
    times, contents = [], set()
    for _ in range(11):
        frame = world.frame
        image = frame.vehicles["V1"].cameras["front"]
        times.append(image.time)
        if image.time == frame.time:
            contents.add(pixels(world))
            distance = np.linalg.norm(image.pose.position - frame.vehicles["V1"].pose.position)
            assert math.isclose(distance, offset, rel_tol=1e-9)
        world.step(drive(frame))
    # n / 30 s, at the first tick of 10 ms that is not earlier
    np.testing.assert_allclose(times, [0.0, 0.0, 0.0, 0.0, 0.04, 0.04, 0.04, 0.07, 0.07, 0.07, 0.10])
    assert len(contents) == 4  # each image differs: the car moves


def test_the_car_ahead_is_where_geometry_says(world: World) -> None:
    """V2 stands 0.6 m ahead, in the middle of the image."""
    image = world.frame.vehicles["V1"].cameras["front"]
    assert image.labels is not None
    assert image.depth is not None
    rows, columns = np.nonzero(image.labels == Label.VEHICLE)
    assert abs(columns.mean() - 48) < 3
    assert len(rows) > 100
    assert 0.1 < image.depth[rows, columns].min() < 0.6
    rear = world.frame.vehicles["V1"].cameras["rear"]
    assert rear.labels is None
    assert rear.depth is None


def test_without_cameras_frames_have_no_images_and_are_otherwise_equal(world: World, scenario: ScenarioSpec) -> None:
    blind = autodrive.make(scenario)
    for _ in range(5):
        seeing, other = world.step(drive(world.frame)), blind.step(drive(blind.frame))
        assert other.vehicles["V1"].cameras == {}
        assert list(bytes_of(seeing.vehicles["V1"].lidar)) == list(bytes_of(other.vehicles["V1"].lidar))
        assert list(bytes_of(seeing.vehicles["V1"].pose)) == list(bytes_of(other.vehicles["V1"].pose))


# -- changes between ticks --------------------------------------------------------------------------------------


def test_a_teleport_shows_at_once(world: World) -> None:
    before, other = pixels(world), pixels(world, "V2", "rear")
    world.teleport("V1", -0.4, 0.5, 1.0)
    assert world.frame.vehicles["V1"].cameras["front"].time == world.frame.time
    assert pixels(world) != before
    assert pixels(world, "V2", "rear") != other  # V1 was in that image


def test_the_scene_light_shows_at_once(world: World) -> None:
    day = world.frame.vehicles["V1"].cameras["front"].rgb.mean()
    world.set_scene_light(False)
    assert world.frame.vehicles["V1"].cameras["front"].rgb.mean() < 0.5 * day


def test_a_change_of_the_driving_mode_draws_nothing(world: World) -> None:
    before = world.frame.vehicles["V1"].cameras["front"]
    world.set_driving_mode("V1", False)
    assert world.frame.vehicles["V1"].cameras["front"] is before


# -- reproducible runs ------------------------------------------------------------------------------------------


@pytest.mark.process
def test_reset_and_another_process_give_the_same_images(world: World, car: str) -> None:
    first = digests(world, 12, drive)
    world.reset()
    assert digests(world, 12, drive) == first
    program = (
        "import json, sys, autodrive\n"
        "from tests.graphics.cameras.conftest import two_cars\n"
        "from tests.graphics.cameras.test_tick_cameras import drive\n"
        "from tests.support.frames import digests\n"
        "print(json.dumps(digests(autodrive.make(two_cars(sys.argv[1]), cameras=True), 12, drive)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, car],
        cwd=ROOT,
        env={**os.environ, "PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == first


def test_restore_gives_the_same_images(world: World) -> None:
    digests(world, 5, drive)
    saved = world.save()
    future = digests(world, 12, drive)
    world.set_scene_light(False)
    world.restore(saved)
    assert digests(world, 12, drive) == future


def test_a_world_can_be_stepped_in_another_thread(world: World, scenario: ScenarioSpec) -> None:
    here = digests(world, 8, drive)
    other = autodrive.make(scenario, cameras=True)
    there: list[str] = []
    thread = threading.Thread(target=lambda: there.extend(digests(other, 8, drive)))
    thread.start()
    thread.join()
    assert there == here
    for one in (world, other):  # and in this one again
        one.step()
    assert pixels(world) == pixels(other)
    other.close()  # a closed world does not disturb the others
    world.step()
    assert world.frame.vehicles["V1"].cameras["front"].rgb.std() > 5.0


def test_two_worlds_that_draw_in_turn_draw_the_same(world: World, other_world: World) -> None:
    other_world.reset()
    for _ in range(5):
        for one in (world, other_world):
            one.step()
        assert pixels(world) == pixels(other_world)


# -- without OpenGL ---------------------------------------------------------------------------------------------


@pytest.mark.process
def test_without_opengl_the_error_names_the_packages_and_worlds_without_cameras_run(tmp_path: Path) -> None:
    program = (
        "import autodrive, sys\n"
        "from autodrive.scenario import ScenarioSpec, VehiclePlacement\n"
        "try: autodrive.make(cameras=True)\n"
        "except autodrive.GlUnavailable as error: print(error)\n"
        "autodrive.make('plane').step()\n"
        "no_cameras = ScenarioSpec(vehicles={'V1': VehiclePlacement(type=sys.argv[1])})\n"
        "autodrive.make(no_cameras, cameras=True).step()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, car_file(tmp_path, {"cameras": {}})],
        env={**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": os.devnull},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.count("\n") == 1
    assert f"apt-get install -y --no-install-recommends {PACKAGES}" in done.stdout
