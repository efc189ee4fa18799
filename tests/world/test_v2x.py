"""The radio channel against the closed forms of its distributions, and against the Frames that were sent."""

from __future__ import annotations

import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import SpecError
from autodrive.protocol.messages import Command, Frame, Headlights, HeardVehicle
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.recording.resimulation import resimulate
from autodrive.scenario import ScenarioSpec
from autodrive.world import World
from tests.support.frames import digest

TICK = 0.01


def town(map_: str = "plane", *, cars: int = 2, gap: float = 1.0, seed: int = 3, **v2x: float) -> World:
    """Cars side by side, `gap` [m] apart."""
    vehicles = {f"V{i}": {"y": i * gap} for i in range(1, cars + 1)}
    return autodrive.make(ScenarioSpec.model_validate({"map": map_, "vehicles": vehicles, "seed": seed, "v2x": v2x}))


def heard(frame: Frame, receiver: str = "V1", sender: str = "V2") -> HeardVehicle | None:
    reading = frame.vehicles[receiver].v2x
    assert reading is not None
    return reading.vehicles.get(sender)


def messages(world: World, ticks: int) -> list[HeardVehicle]:
    """All different ones that V1 hears of V2."""
    found: dict[float, HeardVehicle] = {}
    for _ in range(ticks):
        message = heard(world.step())
        if message is not None:
            found.setdefault(message.sent, message)
    return list(found.values())


def test_without_a_channel_nothing_is_heard() -> None:
    assert {vehicle.v2x for vehicle in autodrive.make("two_cars").step().vehicles.values()} == {None}


def test_an_ideal_channel_says_what_the_other_is_in_the_same_frame() -> None:
    world = town(rate=1.0 / TICK)
    for i in range(30):
        frame = world.step({"V2": Command(0.5, 0.3, Headlights.LOW)})
        message, other = heard(frame), frame.vehicles["V2"]
        assert message is not None
        assert message.sent == message.received == frame.time
        assert (message.position == other.pose.position).all()
        assert (message.speed, message.steering, message.lights) == (other.speed, other.steering, other.lights)
        assert math.remainder(message.yaw, 2.0 * math.pi) == pytest.approx(
            2.0 * math.atan2(*other.pose.orientation[[3, 0]]),
            abs=1e-6,  # the car pitches a little
        )
        assert heard(frame, "V1", "V1") is None
        assert i < 20 or message.speed > 0.05


@pytest.mark.parametrize("rate", [10.0, 30.0, 7.5])
def test_messages_come_at_the_rate_of_the_channel(rate: float) -> None:
    times = [message.sent for message in messages(town(rate=rate), 400)]
    # sent in the first tick that is not earlier than each multiple of the period
    expected = [math.ceil(k / rate / TICK - 1e-9) * TICK for k in range(round(4.0 * rate) + 1)]
    assert times == pytest.approx(expected[: len(times)])
    assert len(times) >= len(expected) - 1


def test_a_message_arrives_after_the_delay_and_says_what_was_when_it_was_sent() -> None:
    world = town(rate=20.0, delay=0.123)
    sent = {0.0: world.frame}
    for _ in range(100):
        frame = world.step({"V2": Command(1.0, 0.0)})
        sent[frame.time] = frame
        message = heard(frame)
        if frame.time < 0.123:
            assert message is None
        else:
            assert message is not None
            assert message.received - message.sent == pytest.approx(0.13)  # the first tick after the delay
            assert frame.time - message.received < 0.05 - 1e-9
            assert (message.position == sent[message.sent].vehicles["V2"].pose.position).all()


def test_range_is_the_distance_between_sender_and_receiver() -> None:
    world = town(cars=4, range=2.0, gap=0.999)
    reading = [vehicle.v2x for vehicle in world.step().vehicles.values()]
    assert [list(heard.vehicles) for heard in reading if heard] == [
        ["V2", "V3"],
        ["V1", "V3", "V4"],
        ["V1", "V2", "V4"],
        ["V2", "V3"],
    ]
    assert [
        len(vehicle.v2x.vehicles)
        for vehicle in town(cars=4, range=2.0, gap=1.001).step().vehicles.values()
        if vehicle.v2x
    ] == [
        1,
        2,
        2,
        1,
    ]


def test_loss_has_its_probability() -> None:
    n, loss = 1000, 0.3
    got = len(messages(town(rate=1.0 / TICK, loss=loss), n - 1))
    deviation = math.sqrt(n * loss * (1.0 - loss))
    assert abs(got - n * (1.0 - loss)) < 4.0 * deviation  # 4 sigma, with a fixed seed
    assert messages(town(loss=1.0), 50) == []


def test_delays_beyond_the_least_are_exponentially_distributed() -> None:
    """Messages so seldom that none overtakes another; the time is that of the next tick."""
    delay, jitter, n = 0.02, 0.05, 150
    spent = np.array([m.received - m.sent for m in messages(town(rate=2.0, delay=delay, jitter=jitter), 50 * n)])
    for time in (0.03, 0.05, 0.08, 0.15):  # multiples of a tick: no rounding of arrivals before them
        share, expected = float((spent <= time + 1e-9).mean()), 1.0 - math.exp(-(time - delay) / jitter)
        assert abs(share - expected) < 4.0 * math.sqrt(expected * (1.0 - expected) / len(spent))
    assert len(spent) >= n - 1


def test_noise_of_the_position_is_normal_and_leaves_the_rest() -> None:
    sigma = 0.2
    world = town(rate=1.0 / TICK, position_noise=sigma)
    off = np.array([m.position - world.frame.vehicles["V2"].pose.position for m in messages(world, 500)])
    assert (np.abs(off[:, 2]) < 1e-3).all()
    errors = off[:, :2].ravel() / sigma
    for level in (-1.5, -0.5, 0.0, 0.5, 1.5):
        p = NormalDist().cdf(level)
        assert abs((errors < level).mean() - p) < 4.0 * math.sqrt(p * (1.0 - p) / len(errors))
    assert abs(np.corrcoef(off[:, 0], off[:, 1])[0, 1]) < 4.0 / math.sqrt(len(off))


def test_lights_say_their_phase_and_the_time_to_change() -> None:
    scenario = {"map": "crossing", "vehicles": {"V1": {"x": -1.9, "y": -0.15}}, "v2x": {"range": 2.0, "rate": 100}}
    frame = autodrive.make(ScenarioSpec.model_validate(scenario)).step()
    reading = frame.vehicles["V1"].v2x
    assert reading is not None
    assert list(reading.lights) == ["traffic_light_3", "traffic_light_4"]  # the others are 2.9 m away
    for name, light in reading.lights.items():
        assert (light.state, light.time_to_change) == (
            frame.traffic_lights[name].state,
            frame.traffic_lights[name].time_to_change,
        )


def test_a_recording_has_what_was_heard_and_is_simulated_again_with_the_same_bits(tmp_path: Path) -> None:
    world = town("crossing", rate=30.0, delay=0.03, jitter=0.02, loss=0.3, position_noise=0.1)
    first = world.frame
    with Recorder(tmp_path / "radio.mcap", world, has_meshes=False):
        frames = [world.step({"V1": Command(0.5, 0.1)}) for _ in range(60)]
    with open_recording(tmp_path / "radio.mcap") as recording:
        read = {frame.tick: digest(frame.vehicles["V1"].v2x) for frame in recording.frames()}
        assert len(read) > 10
        shown = {frame.tick: digest(frame.vehicles["V1"].v2x) for frame in [first, *frames]}
        assert read.items() <= shown.items()
        assert str(resimulate(recording)) == "identical"


def test_a_wrong_channel_is_an_error_that_says_where(tmp_path: Path) -> None:
    file = tmp_path / "radio.yaml"
    file.write_text("map: plane\nv2x: {loss: 1.5}\n")
    with pytest.raises(SpecError, match=r"^v2x.loss \(line 2\): must be at most 1, not 1.5"):
        autodrive.make(file)
