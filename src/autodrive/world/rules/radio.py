"""The radio channel over which vehicles hear each other and traffic lights.

A vehicle hears a message in the first Frame that is not earlier than its arrival. A message that another one of the
same sender has overtaken is dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.elementary import atan2, log
from autodrive.base.exact_fraction import exact_fraction
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.physics.sensors.random_stream import Stream, inverse_normal, new_stream, uniform
from autodrive.physics.sensors.sensor import Schedule, random_generator
from autodrive.physics.state import State
from autodrive.protocol.messages import (
    Headlights,
    HeardLight,
    HeardVehicle,
    Indicators,
    Lights,
    TailLights,
    TrafficLightState,
    V2xReading,
)
from autodrive.scenario.v2x import V2xSpec
from autodrive.world.compile import CompiledScenario
from autodrive.world.rules.lights import LightColumns

X, Y, Z, YAW, SPEED, STEERING, LAMPS = range(7)
"""Columns of the message of a vehicle; `LAMPS`: see `lamps_number`."""
LIGHT_STATE, TIME_TO_CHANGE = 2, 3
"""Columns of the message of a traffic light, behind X and Y; the time [s] is not a number if it never changes."""
COLUMNS = 7
SENT, RECEIVED, CONTENT = 0, 1, 2
"""Columns of what was heard: times [s], and from `CONTENT` on the message."""
LONGEST = 37.0
"""A random part of the delay is at most this multiple of its mean: -log(2^-53) = 36.7."""


class RadioChannel(NamedTuple):
    """The radio channel of a scenario, which does not change."""

    samples: int
    """Messages of a sender in `ticks`."""
    ticks: int
    """Ticks in which `samples` messages are due."""
    range: float
    """Greatest distance of a receiver [m]."""
    delay: float
    """Least time from sending to reception [s]."""
    jitter: float
    """Mean of the random part of the delay [s]."""
    loss: float
    """Probability that a message is lost, 0 to 1."""
    position_noise: float
    """Standard deviation of the noise of x and y in a message of a vehicle [m]."""


class RadioMemory(NamedTuple):
    """Working memory of a tick."""

    messages: Floats
    """Messages of all senders, shape (s, COLUMNS). The caller writes the column `LAMPS`."""


class RadioColumns(NamedTuple):
    """The channels of n worlds: s senders, first the vehicles and then the lights, and v vehicles that hear them.

    All send at the same time. The latest c messages of each sender are kept, as many as can be on their way.
    """

    stream: Stream
    """Random numbers of each channel, shape (n, 3)."""
    sendings: Integers
    """Messages of each sender since the reset, shape (n,)."""
    sent: Floats
    """Time at which each kept message was sent [s], shape (n, c)."""
    content: Floats
    """Content of each kept message of each sender, shape (n, c, s, COLUMNS)."""
    arrival: Floats
    """Time at which each vehicle gets each kept message [s]; infinite: never, shape (n, c, s, v)."""
    heard: Floats
    """Latest message that each vehicle heard of each sender; not a number before, shape (n, v, s, 2 + COLUMNS)."""


def table(c: CompiledScenario) -> RadioChannel:
    """The radio channel of a scenario; one that nothing uses if the scenario has none."""
    spec = c.spec.v2x or V2xSpec()
    due = Schedule.of(spec.rate, exact_fraction(c.spec.tick))
    return RadioChannel(due.samples, due.substeps, spec.range, spec.delay, spec.jitter, spec.loss, spec.position_noise)


def columns(c: CompiledScenario, n: int) -> RadioColumns:
    """Columns of n worlds of the scenario, in which nothing was sent; without a channel, there are no senders."""
    spec, vehicles = c.spec.v2x, len(c.vehicles)
    senders, kept = (
        (0, 0) if spec is None else (vehicles + len(c.map.traffic_lights), _most_on_their_way(spec, c.spec.tick))
    )
    return RadioColumns(
        stream=np.zeros((n, 3), np.uint64),
        sendings=np.zeros(n, np.int64),
        sent=np.zeros((n, kept)),
        content=np.zeros((n, kept, senders, COLUMNS)),
        arrival=np.zeros((n, kept, senders, vehicles)),
        heard=np.full((n, vehicles, senders, CONTENT + COLUMNS), np.nan),
    )


def memory(c: CompiledScenario) -> RadioMemory:
    """Working memory for one world of the scenario, with the places of the lights."""
    vehicles, lights = len(c.vehicles), c.map.light_poses
    messages = np.zeros((vehicles + len(lights), COLUMNS))
    for row, pose in zip(messages[vehicles:], lights.values(), strict=True):
        row[:LIGHT_STATE] = pose[:2]
    return RadioMemory(messages)


def begin(columns: RadioColumns, chosen: Integers, seeds: Sequence[int]) -> None:
    """Forget all messages of the `chosen` worlds, and start their random numbers with these `seeds`."""
    if columns.heard.shape[2] == 0:
        return
    for k, seed in zip(chosen.tolist(), seeds, strict=True):
        columns.stream[k] = new_stream(random_generator(seed, "", "v2x"))
    columns.sendings[chosen] = 0
    columns.heard[chosen] = np.nan


def _most_on_their_way(spec: V2xSpec, tick: float) -> int:
    """Messages of a sender until one of them is heard or lost, with those of the first and the last tick."""
    return int((spec.delay + LONGEST * spec.jitter) * min(spec.rate, 1.0 / tick)) + 3


@jit_uncounted
def transmit(
    k: int,
    tick: int,
    time: float,
    state: State,
    lights: LightColumns,
    channel: RadioChannel,
    radio: RadioColumns,
    memory: RadioMemory,
) -> bool:
    """Send the messages of world k if they are due, and deliver what has arrived; True if anything was heard.

    The channel uses as many random numbers for each sending, whatever is in range.
    """
    vehicles = radio.heard.shape[1]
    if radio.heard.shape[2] == 0:
        return False
    samples, ticks = channel.samples, channel.ticks
    if radio.sendings[k] == 0 or tick * samples // ticks > (tick - 1) * samples // ticks:
        _write_vehicles(state, memory.messages)
        for light in range(lights.state.shape[1]):
            memory.messages[vehicles + light, LIGHT_STATE] = lights.state[k, light]
            memory.messages[vehicles + light, TIME_TO_CHANGE] = lights.time_to_change[k, light]
        _send(k, channel, radio, memory.messages, time)
    return _deliver(k, radio, time)


@inlined
def _write_vehicles(state: State, messages: Floats) -> None:
    """Write the messages of the vehicles but for their lamps."""
    for i in range(state.vehicle_position.shape[0]):
        for axis in range(3):
            messages[i, axis] = state.vehicle_position[i, axis]
        q = state.vehicle_orientation[i]
        w, x, y, z = q[0], q[1], q[2], q[3]
        messages[i, YAW] = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        messages[i, SPEED], messages[i, STEERING] = state.vehicle_velocity[i, 0], state.steering_angle[i]


@inlined
def _send(k: int, channel: RadioChannel, radio: RadioColumns, messages: Floats, time: float) -> None:
    """Keep the messages of all senders of world k, and draw when each vehicle gets them."""
    stream, vehicles = radio.stream[k], radio.heard.shape[1]
    # the oldest messages give way
    slot = radio.sendings[k] % radio.sent.shape[1]
    radio.sendings[k] += 1
    radio.sent[k, slot] = time
    for s in range(messages.shape[0]):
        for column in range(COLUMNS):
            radio.content[k, slot, s, column] = messages[s, column]
    # the positions that vehicles send are measured
    for i in range(vehicles):
        for axis in range(2):
            chance = uniform(stream)
            if channel.position_noise > 0.0:
                radio.content[k, slot, i, axis] += channel.position_noise * inverse_normal(chance)
    # each message is lost, out of range, or arrives after the delay and an exponential part of it
    for s in range(messages.shape[0]):
        for i in range(vehicles):
            fate, lateness = uniform(stream), uniform(stream)
            dx, dy = messages[i, X] - messages[s, X], messages[i, Y] - messages[s, Y]
            arrival = np.inf
            if i != s and sqrt(dx * dx + dy * dy) <= channel.range and fate >= channel.loss:
                arrival = time + channel.delay
                if channel.jitter > 0.0:
                    arrival -= channel.jitter * log(lateness)
            radio.arrival[k, slot, s, i] = arrival


@inlined
def _deliver(k: int, radio: RadioColumns, time: float) -> bool:
    """Let each vehicle hear the newest message of each sender that has arrived; older ones were overtaken."""
    is_new = False
    kept, count = radio.sent.shape[1], radio.sendings[k]
    for i in range(radio.heard.shape[1]):
        for s in range(radio.heard.shape[2]):
            heard = radio.heard[k, i, s]
            for back in range(1, min(kept, count) + 1):
                slot = (count - back) % kept
                if heard[SENT] >= radio.sent[k, slot]:  # not a number: False
                    break
                if radio.arrival[k, slot, s, i] <= time + 1e-9:  # rounding of time
                    heard[SENT], heard[RECEIVED] = radio.sent[k, slot], time
                    for column in range(COLUMNS):
                        heard[CONTENT + column] = radio.content[k, slot, s, column]
                    is_new = True
                    break
    return is_new


def readings(c: CompiledScenario, columns: RadioColumns) -> list[V2xReading]:
    """What each vehicle of a World has heard; empty without a channel."""
    if columns.heard.shape[2] == 0:
        return []
    return [_reading(list(c.vehicles), c.map.traffic_lights, rows) for rows in columns.heard[0]]


def _reading(names: Sequence[str], light_names: Sequence[str], rows: Floats) -> V2xReading:
    """What a vehicle has heard; `rows`: see `RadioColumns.heard`."""
    vehicles: dict[str, HeardVehicle] = {}
    for name, row in zip(names, rows, strict=False):
        if row[SENT] >= 0.0:
            sent, received, *_, yaw, speed, steering, number = row.tolist()
            position = read_only_copy(row[CONTENT : CONTENT + 3])
            vehicles[name] = HeardVehicle(sent, received, position, yaw, speed, steering, lamps_of(int(number)))
    lights: dict[str, HeardLight] = {}
    for name, row in zip(light_names, rows[len(names) :].tolist(), strict=True):
        sent, received, _, _, state, change, *_ = row
        if sent >= 0.0:
            lights[name] = HeardLight(
                sent, received, TrafficLightState(int(state)), None if np.isnan(change) else change
            )
    return V2xReading(vehicles, lights)


LAMP_STATES = len(Headlights), len(Indicators), len(TailLights), 2, 2, 2
"""Number of values of each field of `Lights`."""


def lamps_number(lights: Lights) -> int:
    """The lamps as one number of a message."""
    return int(np.ravel_multi_index([int(getattr(lights, name)) for name in Lights.__struct_fields__], LAMP_STATES))


def lamps_of(number: int) -> Lights:
    """The lamps of which `lamps_number` has made that number."""
    headlights, indicators, tail, *rest = (int(value) for value in np.unravel_index(number, LAMP_STATES))
    return Lights(Headlights(headlights), Indicators(indicators), TailLights(tail), *map(bool, rest))
