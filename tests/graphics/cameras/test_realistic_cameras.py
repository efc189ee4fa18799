"""Cameras with the imperfections of real hardware: what they change, and reproducible noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive.physics.sensors.camera.imperfections import PRESETS
from autodrive.protocol.messages import CameraImage, Command
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.graphics.cameras.conftest import SMALL
from tests.support.cars import car_file

pytestmark = pytest.mark.slow


def make(folder: Path, seed: int = 3, *, is_realistic: bool = True) -> World:
    cars = {
        name: VehiclePlacement(type=car_file(folder, SMALL), x=x, has_realistic_sensors=is_realistic)
        for name, x in (("V1", 0.0), ("V2", 0.6))
    }
    return autodrive.make(ScenarioSpec(map="mini_map", vehicles=cars, seed=seed), cameras=True)


def front(world: World, vehicle: str = "V1") -> CameraImage:
    return world.frame.vehicles[vehicle].cameras["front"]


def drive(world: World, ticks: int = 8) -> bytes:
    for _ in range(ticks):
        world.step({"V1": Command(throttle=1.0, steering=0.5)})
    return front(world).rgba.tobytes()


@pytest.mark.usefixtures("gl")
def test_realistic_images_have_the_distortion_of_the_hardware_and_noise_without_bias(tmp_path: Path) -> None:
    world, ideal = make(tmp_path), make(tmp_path, is_realistic=False)
    assert front(world).intrinsics.distortion == PRESETS["raspberry_pi_v1"].distortion
    assert not any(front(ideal).intrinsics.distortion)
    assert front(world).rgba.shape == front(ideal).rgba.shape == (72, 96, 4)
    # in the middle of the image of a standing car, lens and shutter change little, and noise averages out
    seen, true = (front(one).rgb[20:50, 30:66].astype(float) for one in (world, ideal))
    assert abs(seen - true).mean() > 0.5
    np.testing.assert_allclose(seen.mean(), true.mean(), rtol=0.05)


@pytest.mark.usefixtures("gl")
def test_realistic_images_are_reproducible_by_seed_and_after_restore(tmp_path: Path) -> None:
    world = make(tmp_path)
    saved = world.save()
    first = drive(world)
    world.restore(saved)
    assert drive(world) == first
    assert drive(make(tmp_path)) == first
    assert drive(make(tmp_path, seed=4)) != first
