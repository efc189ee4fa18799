"""The conformance check accepts bridges that keep the rules, and finds each violation of a rule."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.conformance import ConformanceError, check_bridge
from autodrive.protocol.messages import Frame
from autodrive.world.simulation import Simulation


def test_the_devkit_bridge_conforms() -> None:
    check_bridge(lambda simulation: DevkitBridge(simulation, port=1))


class Relay:
    """A bridge that conforms and does nothing; each wrong one below breaks one rule of it."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.closing = threading.Event()
        self.thread: threading.Thread | None = None

    def start(self) -> None:
        self.closing.clear()
        self.simulation.add_sink(self)
        self.thread = threading.Thread(target=self.closing.wait, name="relay", daemon=True)
        self.thread.start()

    def close(self) -> None:
        if self.thread is not None:
            self.simulation.remove_sink(self)
            self.closing.set()
            self.thread.join()
            self.thread = None

    def publish(self, frame: Frame) -> None:
        pass


class LeavesItsThread(Relay):
    def close(self) -> None:
        if self.thread is not None:
            self.simulation.remove_sink(self)
            self.thread = None


class ClosesOnce(Relay):
    def close(self) -> None:
        assert self.thread is not None, "not started"
        super().close()


class StartsOnce(Relay):
    def close(self) -> None:
        super().close()
        self.closing = None  # pyright: ignore[reportAttributeAccessIssue]


class WaitsForItsPeer(Relay):
    def publish(self, frame: Frame) -> None:
        self.closing.wait()


class NeverStarts(Relay):
    def start(self) -> None:
        threading.Event().wait()


def test_a_custom_bridge_conforms() -> None:
    check_bridge(Relay)


@pytest.mark.parametrize(
    ("bridge", "error"),
    [
        (LeavesItsThread, "`close` leaves threads: relay"),
        (ClosesOnce, "`close` before `start` raises AssertionError: not started"),
        (StartsOnce, "the second `start` raises AttributeError"),
        (WaitsForItsPeer, "`publish` must return at once"),
        (NeverStarts, "the first `start` does not return"),
    ],
)
def test_a_wrong_bridge_is_found(
    bridge: Callable[[Simulation], Relay], error: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.connect.conformance.PATIENCE", 0.5)  # these never do what they are waited for
    with pytest.raises(ConformanceError) as raised:
        check_bridge(bridge, ticks=20)
    assert any(error in one for one in raised.value.errors), raised.value
