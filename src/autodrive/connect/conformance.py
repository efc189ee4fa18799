"""Conformance check for bridges that are written outside of this package; call it from your own tests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import Frame
from autodrive.world import World
from autodrive.world.factory import compile_scenario
from autodrive.world.simulation import Simulation

PATIENCE = 20.0
"""Longest wait for a bridge [s]. A good bridge needs milliseconds; a loaded machine gets more time."""


class ConformanceError(AutodriveError):
    """What a bridge does wrong; `errors` has one sentence for each."""

    def __init__(self, subject: str, errors: list[str]) -> None:
        self.errors = errors
        super().__init__("\n".join([f"{subject} does not conform:", *(f"  - {error}" for error in errors)]))


class Bridge(Protocol):
    """Connects a running Simulation to something else; a Sink of that Simulation while it is started."""

    def start(self) -> None:
        """Begin, without waiting for a peer. Adds a Sink to the Simulation."""
        ...

    def close(self) -> None:
        """End all threads and remove the Sink."""
        ...

    def publish(self, frame: Frame) -> None:
        """Take a new Frame, in the thread of the Simulation; return at once."""
        ...


def check_bridge(make: Callable[[Simulation], Bridge], *, scenario: str | Path = "plane", ticks: int = 200) -> None:
    """Check a bridge whose peer does not answer. Raises `ConformanceError`.

    `make` returns a bridge that is not started, for a Simulation that runs as fast as it can. The rules:

    - Without a peer the simulation continues: `start` and `publish` do not wait.
    - `publish` works before `start` and after `close`, and does not raise.
    - `close` ends all threads of the bridge, also when it is called twice or before `start`.
    - A closed bridge can be started again.
    """
    errors: list[str] = []
    world = World(compile_scenario(scenario))
    before = set(threading.enumerate())
    simulation = Simulation(world, speed=None)
    bridge = make(simulation)
    _call(bridge.close, "`close` before `start`", errors)
    _call(lambda: bridge.publish(world.frame), "`publish` before `start`", errors)
    for attempt in ("the first", "the second"):
        _call(bridge.start, f"{attempt} `start`", errors)
        simulation.start(ticks * world.tick_duration)
        goes_on = simulation.wait(PATIENCE)
        if not goes_on:
            errors.append(f"the simulation stops after {attempt} `start`: `publish` must return at once")
        _call(bridge.close, f"`close` after {attempt} `start`", errors)
        _call(simulation.stop, "the simulation's `stop`", errors)
        if not goes_on:
            break
    _call(bridge.close, "a second `close`", errors)
    _call(lambda: bridge.publish(world.frame), "`publish` after `close`", errors)
    if left := _threads_left(before):
        errors.append(f"`close` leaves threads: {', '.join(sorted(left))}")
    world.close()
    if errors:
        raise ConformanceError(type(bridge).__name__, errors)


def _call(function: Callable[[], None], name: str, errors: list[str]) -> None:
    """Call it in a thread of its own, so that a function that never returns is an error and no hang."""
    raised: list[Exception] = []

    def call() -> None:
        try:
            function()
        except Exception as error:
            raised.append(error)

    thread = threading.Thread(target=call, name="autodrive-testing", daemon=True)
    thread.start()
    thread.join(PATIENCE)
    if thread.is_alive():
        errors.append(f"{name} does not return")
    errors.extend(f"{name} raises {type(error).__name__}: {error}" for error in raised)


def _threads_left(before: set[threading.Thread]) -> list[str]:
    """Threads that were not there before and do not end; a thread may need a moment."""
    deadline = time.monotonic() + PATIENCE
    while True:
        left = [
            thread.name
            for thread in set(threading.enumerate()) - before
            if thread.is_alive() and thread.name != "autodrive-testing"
        ]
        if not left or time.monotonic() > deadline:
            return left
        time.sleep(0.01)
