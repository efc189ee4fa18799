"""Vehicles and scenarios with small images, made once, and what tests of the process that draws share."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import autodrive
from autodrive.graphics.cameras import render_process
from autodrive.graphics.cameras.render_process import RenderProcess
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.cars import car_file

SMALL = {f"cameras.{name}.{edge}": size for name in ("front", "rear") for edge, size in (("width", 96), ("height", 72))}
"""Images of 96 x 72 pixels."""


class Clock:
    """Wall time that a test sets."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


@contextmanager
def stopped(process: RenderProcess) -> Iterator[None]:
    """The worker does nothing meanwhile."""
    pid = process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the process that draws logged; other loggers may warn about a busy machine."""
    return [record.message for record in caplog.records if record.name == render_process.__name__]


def two_cars(car: str) -> ScenarioSpec:
    """V2 stands 0.6 m ahead of V1."""
    vehicles = {"V1": VehiclePlacement(type=car), "V2": VehiclePlacement(type=car, x=0.6)}
    return ScenarioSpec(map="mini_map", vehicles=vehicles, seed=3)


@pytest.fixture(scope="module")
def shared_world() -> World:
    return autodrive.make("two_cars")


@pytest.fixture
def world(shared_world: World) -> World:
    """The world that the tests of a module share, after a reset."""
    shared_world.reset()
    return shared_world


@pytest.fixture(scope="package")
def car(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Nigel with small images at 30 Hz; those of the front camera have depth and labels."""
    rates = {"cameras.front.rate": 30.0, "cameras.rear.rate": 30.0}
    extras = {"cameras.front.depth": True, "cameras.front.labels": True}
    return car_file(tmp_path_factory.mktemp("car"), {**SMALL, **rates, **extras})


@pytest.fixture(scope="package")
def scenario(car: str) -> ScenarioSpec:
    """Two of these cars, one behind the other."""
    return two_cars(car)
