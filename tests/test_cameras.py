"""Pictures in Frames: drawn in the tick that they are due in, of exactly that state, the same bytes each run."""

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
from autodrive.protocol.messages import Command, Frame, Headlights
from autodrive.render.asset import Label
from autodrive.render.gl import PACKAGES
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World

from .cars import car_file
from .frames import bytes_of, film

ROOT = Path(__file__).parent.parent

SMALL = {f"cameras.{name}.{edge}": size for name in ("front", "rear") for edge, size in (("width", 96), ("height", 72))}
"""Pictures of 96 x 72 pixels are enough here."""


@pytest.fixture
def car(tmp_path: Path) -> str:
    """Nigel with small pictures at 30 Hz, of which the front ones have labels too."""
    rates = {"cameras.front.rate": 30.0, "cameras.rear.rate": 30.0}
    return car_file(tmp_path, {**SMALL, **rates, "cameras.front.labels": True})


def scenario(car: str) -> ScenarioSpec:
    return ScenarioSpec(
        map="mini_map",
        vehicles={"V1": VehiclePlacement(type=car), "V2": VehiclePlacement(type=car, x=0.6)},
        seed=3,
    )


@pytest.fixture
def world(gl: str, car: str) -> World:
    return autodrive.make(scenario(car), cameras=True)


def drive(frame: Frame) -> dict[str, Command]:
    lamps = Headlights(frame.tick // 5 % 3)
    return {"V1": Command(throttle=0.5, steering=math.sin(0.2 * frame.tick), headlights=lamps)}


def pixels(world: World, vehicle: str = "V1", camera: str = "front") -> bytes:
    return world.frame.vehicles[vehicle].cameras[camera].rgba.tobytes()


def test_the_first_frame_has_every_picture(world: World) -> None:
    for vehicle in world.frame.vehicles.values():
        assert list(vehicle.cameras) == ["front", "rear"]
        for image in vehicle.cameras.values():
            assert image.time == 0.0
            assert image.rgba.shape == (72, 96, 4)
            assert (image.rgba[..., 3] == 255).all()
            assert image.rgb.std() > 5.0  # something is to be seen


def test_pictures_are_taken_at_their_rate_and_stay_until_the_next(world: World) -> None:
    times = []
    for _ in range(11):
        image = world.frame.vehicles["V1"].cameras["front"]
        assert image.time <= world.frame.time
        times.append(image.time)
        world.step()
    # n / 30 s, at the first tick of 10 ms that is not before it
    np.testing.assert_allclose(times, [0.0, 0.0, 0.0, 0.0, 0.04, 0.04, 0.04, 0.07, 0.07, 0.07, 0.10])


def test_a_picture_is_of_the_state_in_its_own_frame(world: World) -> None:
    """The optical axis of its pose is the mount's, turned by the vehicle; the moved car sees something else."""
    seen = set()
    for _ in range(20):
        frame = world.step(drive(world.frame))
        image = frame.vehicles["V1"].cameras["front"]
        if image.time == frame.time:
            seen.add(pixels(world))
            offset = image.pose.position - frame.vehicles["V1"].pose.position
            mount = world.vehicle_specs["V1"].cameras["front"].mount
            assert math.isclose(np.linalg.norm(offset), np.linalg.norm(mount.position), rel_tol=1e-9)
    assert len(seen) == 6  # at 30 Hz in 0.2 s


def test_the_car_ahead_is_where_geometry_says(world: World) -> None:
    """V2 stands 0.6 m ahead in the middle; the sky is above, the ground below."""
    labels = world.frame.vehicles["V1"].cameras["front"].labels
    assert labels is not None
    rows, columns = np.nonzero(labels == Label.VEHICLE)
    assert abs(columns.mean() - 48) < 3
    assert len(rows) > 100
    assert world.frame.vehicles["V1"].cameras["rear"].labels is None


def test_without_cameras_frames_have_no_pictures_and_nothing_else_differs(world: World, car: str) -> None:
    blind = autodrive.make(scenario(car))
    for _ in range(5):
        seeing, other = world.step(drive(world.frame)), blind.step(drive(blind.frame))
        assert other.vehicles["V1"].cameras == {}
        assert list(bytes_of(seeing.vehicles["V1"].lidar)) == list(bytes_of(other.vehicles["V1"].lidar))
        assert list(bytes_of(seeing.vehicles["V1"].pose)) == list(bytes_of(other.vehicles["V1"].pose))


# -- what is done by hand ---------------------------------------------------------------------------------------


def test_a_teleport_of_a_world_that_stands_still_shows_at_once(world: World) -> None:
    before, other = pixels(world), pixels(world, "V2", "rear")
    world.teleport("V1", -0.4, 0.5, 1.0)
    assert world.frame.vehicles["V1"].cameras["front"].time == world.frame.time
    assert pixels(world) != before
    assert pixels(world, "V2", "rear") != other  # it saw V1


def test_night_falls_at_once(world: World) -> None:
    day = world.frame.vehicles["V1"].cameras["front"].rgb.mean()
    world.set_scene_light(False)
    assert world.frame.vehicles["V1"].cameras["front"].rgb.mean() < 0.5 * day


def test_a_change_of_the_driving_mode_draws_nothing(world: World) -> None:
    before = world.frame.vehicles["V1"].cameras["front"]
    world.set_driving_mode("V1", False)
    assert world.frame.vehicles["V1"].cameras["front"] is before


# -- the same again ---------------------------------------------------------------------------------------------


def test_reset_brings_the_same_pictures(world: World) -> None:
    first = film(world, 12, drive)
    world.reset()
    assert film(world, 12, drive) == first


def test_restore_brings_the_same_pictures(world: World) -> None:
    film(world, 5, drive)
    saved = world.save()
    future = film(world, 12, drive)
    world.set_scene_light(False)
    world.restore(saved)
    assert film(world, 12, drive) == future


def test_two_fresh_processes_draw_the_same_bytes(gl: str, car: str) -> None:
    program = (
        "import json, sys, autodrive\n"
        "from tests.test_cameras import drive, scenario\n"
        "from tests.frames import film\n"
        "print(json.dumps(film(autodrive.make(scenario(sys.argv[1]), cameras=True), 12, drive)))\n"
    )
    films = [
        json.loads(
            subprocess.run(
                [sys.executable, "-c", program, car],
                cwd=ROOT,
                env={**os.environ, "PYTHONHASHSEED": seed},
                capture_output=True,
                text=True,
                check=True,
                timeout=120,
            ).stdout
        )
        for seed in ("1", "2")
    ]
    assert films[0] == films[1]


def test_a_world_made_here_can_be_stepped_in_another_thread(world: World, car: str) -> None:
    here = film(world, 8, drive)
    other = autodrive.make(scenario(car), cameras=True)
    there: list[str] = []
    thread = threading.Thread(target=lambda: there.extend(film(other, 8, drive)))
    thread.start()
    thread.join()
    assert there == here
    world.step(), other.step()  # and here again
    assert pixels(world) == pixels(other)


def test_worlds_that_draw_do_not_disturb_each_other(world: World, car: str) -> None:
    other = autodrive.make(scenario(car), cameras=True)
    for _ in range(5):
        world.step(), other.step()
        assert pixels(world) == pixels(other)
    other.close()
    world.step()
    assert world.frame.vehicles["V1"].cameras["front"].rgb.std() > 5.0


# -- without OpenGL ---------------------------------------------------------------------------------------------


def call_without_gl(program: str) -> subprocess.CompletedProcess[str]:
    """In a process that finds no driver of OpenGL."""
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": os.devnull},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )


def test_where_nothing_can_draw_the_error_is_one_line_with_the_packages_to_install() -> None:
    done = call_without_gl(
        "import autodrive\ntry: autodrive.make(cameras=True)\nexcept autodrive.GlUnavailable as error: print(error)"
    )
    assert done.stdout.count("\n") == 1
    assert f"apt-get install -y --no-install-recommends {PACKAGES}" in done.stdout


def test_where_nothing_can_draw_a_world_without_cameras_runs(tmp_path: Path) -> None:
    car = car_file(tmp_path, {"cameras": {}})
    call_without_gl(
        f"import autodrive; autodrive.make('plane').step(); from autodrive.scenario import *; "
        f"autodrive.make(ScenarioSpec(vehicles={{'V1': VehiclePlacement(type={car!r})}}), cameras=True).step()"
    )
