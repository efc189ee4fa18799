"""The radio channel over which vehicles hear each other and traffic lights: compiled, for one world or for many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.elementary import atan2, log
from autodrive.base.jit import inlined, jit_uncounted, resolved
from autodrive.base.suggest import ByName
from autodrive.physics.sensors.random_stream import Stream, inverse_normal, new_stream, uniform
from autodrive.physics.sensors.sensor import Schedule, random_generator
from autodrive.physics.state import State
from autodrive.protocol.messages import Frame, HeardLight, HeardVehicle, Lights, TrafficLightState, V2xReading
from autodrive.scenario.maps.shapes import Pose
from autodrive.scenario.v2x import V2xSpec

X, Y, Z, YAW, SPEED, STEERING, LAMPS = range(7)
"""Columns of the message of a vehicle; `LAMPS`: number of its lamps among those that were sent in that world."""
LIGHT_STATE, TIME_TO_CHANGE = 2, 3
"""Likewise, of a traffic light, behind X and Y; the time [s] is not a number if it never changes."""
COLUMNS = 7
SENT, RECEIVED, CONTENT = 0, 1, 2
"""Columns of what was heard: times [s], and from `CONTENT` on the message."""
LONGEST = 37.0
"""A random part of the delay is at most this multiple of its mean: -log(2^-53) = 36.7."""


class Channel(NamedTuple):
    """What does not change; a message is due `samples` times in `ticks`."""

    samples: int
    ticks: int
    range: float
    """[m]."""
    delay: float
    """[s]."""
    jitter: float
    """[s]."""
    loss: float
    position_noise: float
    """[m]."""


class RadioColumns(NamedTuple):
    """The channels of n worlds: s senders, first the vehicles and then the lights, and v vehicles that hear them.

    All send at the same time. The latest c messages of each sender are kept, as many as can be on their way.
    """

    stream: Stream
    """Shape (n, 3)."""
    sendings: Integers
    """Messages of each sender since the reset, shape (n,)."""
    sent: Floats
    """Time of each [s], shape (n, c)."""
    content: Floats
    """Shape (n, c, s, COLUMNS)."""
    arrival: Floats
    """Time at which each vehicle gets it [s]; infinite: never, shape (n, c, s, v)."""
    heard: Floats
    """Latest message that each vehicle heard of each sender; not a number before, shape (n, v, s, 2 + COLUMNS)."""


def channel_of(spec: V2xSpec, tick: float) -> Channel:
    """The channel, for ticks of that duration [s]."""
    due = Schedule.of(spec.rate, Fraction(str(tick)))
    return Channel(due.samples, due.substeps, spec.range, spec.delay, spec.jitter, spec.loss, spec.position_noise)


def radio_columns(spec: V2xSpec | None, n: int, vehicles: int, lights: int, tick: float) -> RadioColumns:
    """Columns of n worlds with so many vehicles and lights; None: there is no channel, and nobody sends."""
    senders, kept = (0, 0) if spec is None else (vehicles + lights, _most_on_their_way(spec, tick))
    return RadioColumns(
        stream=np.zeros((n, 3), np.uint64),
        sendings=np.zeros(n, np.int64),
        sent=np.zeros((n, kept)),
        content=np.zeros((n, kept, senders, COLUMNS)),
        arrival=np.zeros((n, kept, senders, vehicles)),
        heard=np.full((n, vehicles, senders, CONTENT + COLUMNS), np.nan),
    )


def _most_on_their_way(spec: V2xSpec, tick: float) -> int:
    """Messages of a sender until one of them is heard or lost, with those of the first and the last tick."""
    return int((spec.delay + LONGEST * spec.jitter) * min(spec.rate, 1.0 / tick)) + 3


def begin_radio(radio: RadioColumns, k: int, seed: int) -> None:
    """In world k nothing was sent yet; the random numbers of that seed."""
    radio.stream[k] = new_stream(random_generator(seed, "", "v2x"))
    radio.sendings[k] = 0
    radio.heard[k] = np.nan


def new_messages(vehicles: int, lights: Mapping[str, Pose]) -> Floats:
    """Memory for the messages of all senders, shape (s, COLUMNS), with the places of the lights."""
    messages = np.zeros((vehicles + len(lights), COLUMNS))
    for row, pose in zip(messages[vehicles:], lights.values(), strict=True):
        row[:LIGHT_STATE] = pose[:2]
    return messages


@jit_uncounted
def transmit(k: int, channel: Channel, radio: RadioColumns, messages: Floats, tick: int, time: float) -> bool:
    """Send these `messages` of world k if they are due, and deliver what has arrived; True if anything was heard.

    The channel uses as many random numbers for each sending, whatever is in range.
    """
    samples, ticks = channel.samples, channel.ticks
    if radio.sendings[k] == 0 or tick * samples // ticks > (tick - 1) * samples // ticks:
        _send(k, channel, radio, messages, time)
    return _deliver(k, radio, time)


@jit_uncounted
def write_vehicles(position: Floats, orientation: Floats, velocity: Floats, steering: Floats, messages: Floats) -> None:
    """Write the messages of v vehicles but for their lamps; the arguments are columns of the State."""
    for i in range(position.shape[0]):
        for axis in range(3):
            messages[i, axis] = position[i, axis]
        w, x, y, z = orientation[i, 0], orientation[i, 1], orientation[i, 2], orientation[i, 3]
        messages[i, YAW] = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        messages[i, SPEED], messages[i, STEERING] = velocity[i, 0], steering[i]


@inlined
def _send(k: int, channel: Channel, radio: RadioColumns, messages: Floats, time: float) -> None:
    stream, vehicles = radio.stream[k], radio.heard.shape[1]
    slot = radio.sendings[k] % radio.sent.shape[1]
    radio.sendings[k] += 1
    radio.sent[k, slot] = time
    for s in range(messages.shape[0]):
        for column in range(COLUMNS):
            radio.content[k, slot, s, column] = messages[s, column]
    for i in range(vehicles):
        for axis in range(2):
            chance = uniform(stream)
            if channel.position_noise > 0.0:
                radio.content[k, slot, i, axis] += channel.position_noise * inverse_normal(chance)
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


class V2xChannel:
    """Sends the messages of one world and keeps the latest one that each vehicle heard of each sender.

    A vehicle hears a message in the first Frame that is not earlier than its arrival. A message that another one of the
    same sender has overtaken is dropped.
    """

    def __init__(
        self, spec: V2xSpec, vehicles: Sequence[str], lights: Mapping[str, Pose], tick: float, state: State
    ) -> None:
        """`lights`: poses of the traffic lights; `tick`: duration of a tick [s]; `state`: of the vehicles."""
        self._vehicles, self._lights = list(vehicles), list(lights)
        self._radio = radio_columns(spec, 1, len(vehicles), len(lights), tick)
        self._messages = new_messages(len(vehicles), lights)
        self._sending = 0, channel_of(spec, tick), self._radio, self._messages
        """The first arguments of `transmit`."""
        self._seen = state.vehicle_position, state.vehicle_orientation, state.vehicle_velocity, state.steering_angle
        self._transmit = resolved(transmit, *self._sending, 0, 0.0)
        self._write = resolved(write_vehicles, *self._seen, self._messages)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Nothing was sent yet; the random stream of that seed."""
        begin_radio(self._radio, 0, seed)
        self._tick = -1
        """Of the latest Frame."""
        self._lamps: dict[Lights, int] = {}
        """Those that were sent, and their numbers."""
        self._heard = [V2xReading({}, {}) for _ in self._vehicles]

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return [column.copy() for column in self._radio], self._tick, dict(self._lamps), list(self._heard)

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        columns, self._tick, lamps, heard = saved
        for column, kept in zip(self._radio, columns, strict=True):
            column[:] = kept
        self._lamps, self._heard = dict(lamps), list(heard)

    def heard(self, frame: Frame) -> Frame:
        """That Frame with what its vehicles have heard; sends its messages, unless its tick was shown before."""
        if frame.tick > self._tick:
            self._tick = frame.tick
            self._write(*self._seen, self._messages)
            for row, vehicle in zip(self._messages, frame.vehicles.values(), strict=False):
                row[LAMPS] = self._lamps.setdefault(vehicle.lights, len(self._lamps))
            lights = frame.traffic_lights.values()
            for row, light in zip(self._messages[len(self._vehicles) :], lights, strict=True):
                row[LIGHT_STATE] = light.state
                row[TIME_TO_CHANGE] = np.nan if light.time_to_change is None else light.time_to_change
            if self._transmit(*self._sending, frame.tick, frame.time):
                self._heard = [self._reading(rows) for rows in self._radio.heard[0]]
        vehicles = {
            name: replace(vehicle, v2x=heard)
            for (name, vehicle), heard in zip(frame.vehicles.items(), self._heard, strict=True)
        }
        return replace(frame, vehicles=ByName(vehicles))

    def _reading(self, rows: Floats) -> V2xReading:
        """What a vehicle heard; `rows`: see `RadioColumns.heard`."""
        lamps, count = [*self._lamps], len(self._vehicles)
        vehicles: dict[str, HeardVehicle] = {}
        for name, row in zip(self._vehicles, rows, strict=False):
            if row[SENT] >= 0.0:
                sent, received, *_, yaw, speed, steering, number = row.tolist()
                position = read_only_copy(row[CONTENT : CONTENT + 3])
                vehicles[name] = HeardVehicle(sent, received, position, yaw, speed, steering, lamps[int(number)])
        lights: dict[str, HeardLight] = {}
        for name, row in zip(self._lights, rows[count:].tolist(), strict=True):
            sent, received, _, _, state, change, *_ = row
            if sent >= 0.0:
                lights[name] = HeardLight(
                    sent, received, TrafficLightState(int(state)), None if np.isnan(change) else change
                )
        return V2xReading(vehicles, lights)
