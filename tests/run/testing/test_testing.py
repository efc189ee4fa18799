"""The conformance checks accept sensors and bridges that keep the rules, and find each violation of a rule."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.physics.model import Shapes
from autodrive.physics.sensors.noise import Noise, NoiseSpec
from autodrive.physics.sensors.sensor import Sensor
from autodrive.physics.state import State
from autodrive.protocol.messages import Frame, IpsReading
from autodrive.run.testing import ConformanceError, check_bridge, check_sensor
from autodrive.world.simulation import Simulation


class Position(Sensor[IpsReading]):
    """A sensor that conforms; each wrong one below breaks one rule of it."""

    def __init__(self) -> None:
        super().__init__(None)
        self._rng = np.random.default_rng(0)

    def reset(self, rng: np.random.Generator) -> None:
        super().reset(rng)
        self._rng = rng

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        position = state.vehicle_position[vehicle] + self._rng.normal(size=3)
        position.setflags(write=False)
        return IpsReading(time, position)

    def save(self) -> Any:
        return self.latest, self._rng.bit_generator.state

    def restore(self, saved: Any) -> None:
        self.latest, self._rng.bit_generator.state = saved


class ChangesTheState(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        state.throttle[vehicle] += 1.0
        return super().sample(shapes, state, vehicle, time)


class HasWritableArrays(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        return IpsReading(time, state.vehicle_position[vehicle].copy())


class ReturnsTheSameArray(Position):
    def __init__(self) -> None:
        super().__init__()
        self._position = np.zeros(3)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        self._position[:] = state.vehicle_position[vehicle] + time
        view = self._position.view()
        view.setflags(write=False)
        return IpsReading(time, view)


class ReadsTheFuture(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        return super().sample(shapes, state, vehicle, time + 1.0)


class GoesBackInTime(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        return super().sample(shapes, state, vehicle, -time)


class HasItsOwnNoise(Position):
    def reset(self, rng: np.random.Generator) -> None:
        super().reset(np.random.default_rng())


class ForgetsNothing(Position):
    def reset(self, rng: np.random.Generator) -> None:
        Sensor.reset(self, rng)


class SavesNothing(Position):
    def save(self) -> Any:
        return None

    def restore(self, saved: Any) -> None:
        pass


class NeverReads(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        return None


class ReadsNoMessage(Position):
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> Any:
        return object()


class Drifting(Sensor[IpsReading]):
    """A sensor with the noise of this package."""

    def __init__(self) -> None:
        self._noise = Noise((NoiseSpec(sigma=0.01, walk=0.01), 3))
        super().__init__(self._noise)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading | None:
        position = state.vehicle_position[vehicle].copy()
        self._noise.add(position, time)
        position.setflags(write=False)
        return IpsReading(time, position)


@pytest.mark.parametrize("sensor", [Position, Drifting])
def test_a_custom_sensor_conforms(sensor: Callable[[], Sensor[Any]]) -> None:
    check_sensor(sensor, ticks=20)


@pytest.mark.parametrize(
    ("sensor", "error"),
    [
        (ChangesTheState, "changes the State"),
        (HasWritableArrays, "`position` of a reading is writable"),
        (ReturnsTheSameArray, "later samples change an earlier reading"),
        (ReadsTheFuture, "later than the sample"),
        (GoesBackInTime, "earlier than that of the reading before"),
        (HasItsOwnNoise, "draw noise from the generator of `reset`"),
        (ForgetsNothing, "`reset` must forget everything"),
        (SavesNothing, "`save` must return all"),
        (NeverReads, "it returns no reading in 20 ticks"),
        (ReadsNoMessage, "cannot be encoded"),
        (ReadsNoMessage, "has no `time`"),
    ],
)
def test_a_wrong_sensor_is_found(sensor: Callable[[], Sensor[Any]], error: str) -> None:
    with pytest.raises(ConformanceError) as raised:
        check_sensor(sensor, ticks=20)
    assert any(error in one for one in raised.value.errors), raised.value


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
    monkeypatch.setattr("autodrive.run.testing.bridges.PATIENCE", 0.5)  # these never do what they are waited for
    with pytest.raises(ConformanceError) as raised:
        check_bridge(bridge, ticks=20)
    assert any(error in one for one in raised.value.errors), raised.value
