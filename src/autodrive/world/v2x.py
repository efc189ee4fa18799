"""The radio channel over which vehicles hear each other and traffic lights."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from msgspec.structs import replace

from autodrive.base.arrays import Floats, read_only_copy
from autodrive.base.elementary import log
from autodrive.base.jit import jit_uncounted
from autodrive.base.suggest import ByName
from autodrive.base.transforms import yaw_from_quaternion
from autodrive.physics.sensors.random_stream import Stream, inverse_normal, new_stream, uniform
from autodrive.physics.sensors.sensor import Schedule, random_generator
from autodrive.protocol.messages import Frame, HeardLight, HeardVehicle, V2xReading, VehicleFrame
from autodrive.scenario.maps.shapes import Pose
from autodrive.scenario.v2x import V2xSpec

Heard: TypeAlias = HeardVehicle | HeardLight
Pending: TypeAlias = tuple[float, int, int, str, Heard]
"""Time of arrival [s], number of the message, receiver, name of the sender, content."""

NOTHING = V2xReading({}, {})


class V2xChannel:
    """Sends the messages of a world and keeps the latest one that each vehicle heard of each sender.

    A vehicle hears a message in the first Frame that is not earlier than its arrival. A message that another one of the
    same sender has overtaken is dropped. The random numbers are a stream of their own, which gives as many numbers for
    each sending, whatever is in range.
    """

    def __init__(self, spec: V2xSpec, vehicles: Sequence[str], lights: Mapping[str, Pose], tick: float) -> None:
        """`lights`: poses of the traffic lights; `tick`: duration of a tick [s]."""
        self._spec, self._vehicles = spec, list(vehicles)
        self._lights = {name: np.array(pose[:2]) for name, pose in lights.items()}
        self._schedule = Schedule.of(spec.rate, Fraction(str(tick)))
        senders = len(self._vehicles) + len(self._lights)
        self._of_noise = np.empty((len(self._vehicles), 2))
        self._of_channel = np.empty((senders, len(self._vehicles), 2))
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Nothing was sent yet; the random stream of that seed."""
        self._stream: Stream = new_stream(random_generator(seed, "", "v2x"))
        self._tick: int | None = None
        """Of the latest Frame."""
        self._sent = 0
        self._pending: list[Pending] = []
        self._heard = [NOTHING for _ in self._vehicles]

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self._stream.copy(), self._tick, self._sent, list(self._pending), list(self._heard)

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        stream, self._tick, self._sent, pending, heard = saved
        self._stream, self._pending, self._heard = stream.copy(), list(pending), list(heard)

    def heard(self, frame: Frame) -> Frame:
        """That Frame with what its vehicles have heard; sends its messages, unless its tick was shown before."""
        if self._tick is None or frame.tick > self._tick:
            if self._schedule.is_due(frame.tick, self._tick):
                self._send(frame)
            self._tick = frame.tick
            self._deliver(frame.time)
        vehicles = {
            name: replace(vehicle, v2x=heard)
            for (name, vehicle), heard in zip(frame.vehicles.items(), self._heard, strict=True)
        }
        return replace(frame, vehicles=ByName(vehicles))

    def _send(self, frame: Frame) -> None:
        spec, vehicles = self._spec, frame.vehicles
        fill_uniform(self._stream, self._of_noise.reshape(-1))
        fill_uniform(self._stream, self._of_channel.reshape(-1))
        places = [vehicle.pose.position[:2] for vehicle in vehicles.values()]
        messages: list[tuple[str, Floats, Heard]] = []
        for (name, vehicle), place, random in zip(vehicles.items(), places, self._of_noise, strict=True):
            messages.append((name, place, _of_vehicle(frame.time, vehicle, random, spec.position_noise)))
        for (name, place), light in zip(self._lights.items(), frame.traffic_lights.values(), strict=True):
            messages.append((name, place, HeardLight(frame.time, frame.time, light.state, light.time_to_change)))
        for (name, place, message), chances in zip(messages, self._of_channel, strict=True):
            for i, (receiver, chance) in enumerate(zip(self._vehicles, chances.tolist(), strict=True)):
                x, y = (places[i] - place).tolist()
                if receiver == name or math.hypot(x, y) > spec.range or chance[0] < spec.loss:
                    continue
                arrival = frame.time + spec.delay - (spec.jitter * log(chance[1]) if spec.jitter else 0.0)
                heapq.heappush(self._pending, (arrival, self._sent, i, name, message))
                self._sent += 1

    def _deliver(self, time: float) -> None:
        """Let the vehicles hear what has arrived, in the order of arrival."""
        while self._pending and self._pending[0][0] <= time + 1e-9:  # rounding of time
            _, _, receiver, sender, message = heapq.heappop(self._pending)
            heard = self._heard[receiver]
            known = heard.vehicles if isinstance(message, HeardVehicle) else heard.lights
            before = known.get(sender)
            if before is not None and before.sent > message.sent:
                continue
            changed: dict[str, Any] = {**known, sender: replace(message, received=time)}
            field = "vehicles" if isinstance(message, HeardVehicle) else "lights"
            self._heard[receiver] = replace(heard, **{field: changed})


def _of_vehicle(time: float, vehicle: VehicleFrame, random: Floats, deviation: float) -> HeardVehicle:
    """The message of a vehicle; `random`: two uniform numbers in (0, 1)."""
    position = vehicle.pose.position
    if deviation:
        position = position.copy()
        position[:2] += [deviation * inverse_normal(value) for value in random.tolist()]
        position = read_only_copy(position)
    yaw = yaw_from_quaternion(vehicle.pose.orientation)
    return HeardVehicle(time, time, position, yaw, vehicle.speed, vehicle.steering, vehicle.lights)


@jit_uncounted
def fill_uniform(stream: Stream, into: Floats) -> None:
    """Write the next numbers of a stream."""
    for i in range(len(into)):
        into[i] = uniform(stream)
