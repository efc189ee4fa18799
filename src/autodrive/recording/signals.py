"""Signals of a recording as arrays."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import read_only
from autodrive.base.suggest import suggest
from autodrive.protocol.channels import SIGNALS, OwnSignal, Signal
from autodrive.recording import mcap, records, wire
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS


class MessageSource(Protocol):
    """The part of a Recording that is used here."""

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        ...

    @property
    def scan_message(self) -> wire.WireMessage:
        """The message of a scan."""
        ...

    @property
    def own_message(self) -> wire.WireMessage:
        """The message of a reading of a sensor of the user."""
        ...

    def own_sensors(self, vehicle: str) -> dict[str, tuple[str, ...]]:
        """Names of the sensors of the user on a vehicle, and the columns of each."""
        ...

    def messages_of(self, topic: str) -> list[bytes]:
        """The data of all messages of a topic."""
        ...

    def log_times(self, topic: str) -> NDArray[np.float64]:
        """Times of the messages of a topic [s]."""
        ...

    def blocks(self, topics: Collection[str], start: float, end: float) -> Iterator[dict[str, list[mcap.McapMessage]]]:
        """Messages by topic, for each part of the file from a time to another [s]."""
        ...


class Signals(Mapping[str, NDArray[Any]]):
    """The signals by name: vehicle and signal of `protocol.channels`, such as 'V1/ips/position'.

    The first axis of an array belongs to `times(name)`: the Frames, for a LIDAR its scans, for a sensor of the user
    ('V1/own/radar') its samples. A missing reading is NaN.
    """

    def __init__(self, recording: MessageSource, states: records.States) -> None:
        self._recording = recording
        self._states = states
        self._cache: dict[str, NDArray[Any]] = {}
        self._data: dict[str, list[bytes]] = {}
        self.described: dict[str, Signal] = {}
        """The signal of each name, with its unit and the names of its elements."""
        for vehicle in recording.vehicles:
            own = [OwnSignal.of(sensor, columns) for sensor, columns in recording.own_sensors(vehicle).items()]
            for signal in (*SIGNALS, *own):
                self.described[f"{vehicle}/{signal.name.replace('.', '/')}"] = signal

    def __iter__(self) -> Iterator[str]:
        return iter(self.described)

    def __len__(self) -> int:
        return len(self.described)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Raises `RecordingError` for a name that is not known."""
        if name not in self._cache:
            self._cache[name] = read_only(self._read(name))
        return self._cache[name]

    def times(self, name: str) -> NDArray[np.float64]:
        """The time of each value of a signal [s]."""
        return self._recording.log_times(self._topic(name))

    def at_frames(self, name: str) -> NDArray[np.float64]:
        """The values of a sensor of the user in each Frame, shape (n_frame, n_column); NaN without a reading."""
        vehicle, signal = self._vehicle_and_signal(name)
        state = records.state_topic(vehicle)
        (shown,) = self._states.vehicle.columns([["own"]], self._messages(state))
        (times,) = self._message(name).columns([["time"]], self._messages(self._topic(name)))
        rows = np.vstack([self[name], np.full(len(signal.elements), np.nan)])
        latest = np.searchsorted(self.times(name), self._recording.log_times(state), side="right") - 1
        sensor = signal.name.removeprefix("own.")
        for i, own in enumerate(shown):
            while latest[i] >= 0 and times[latest[i]] != own.get(sensor):
                latest[i] -= 1  # two Frames have the same time in the recording: the second one is that of a reset
        return rows[latest]

    def blocks(self, names: Sequence[str], start: float, end: float) -> Iterator[dict[str, tuple[Any, Any]]]:
        """Times [s] and values of signals by name, for each part of the file from a time to another [s].

        The first and the last part may also contain times outside. Nothing is kept in memory.
        """
        topics: dict[str, dict[str, list[str]]] = {}
        for name in names:
            topics.setdefault(self._topic(name), {})[name] = self._path(name)
        for messages in self._recording.blocks(topics, start, end):
            for topic, of_topic in messages.items():
                times = np.array([message.log_time for message in of_topic]) / NANOSECONDS
                message = self._message(next(iter(topics[topic])))
                columns = message.columns(list(topics[topic].values()), [message.data for message in of_topic])
                for name, column in zip(topics[topic], columns, strict=True):
                    for places, values in _arrays(column):
                        yield {name: (times[places], values)}

    def _topic(self, name: str) -> str:
        vehicle, signal = self._vehicle_and_signal(name)
        if isinstance(signal, OwnSignal):
            return records.own_topic(vehicle, signal.name.removeprefix("own."))
        return records.scan_topic(vehicle) if signal.name.startswith("lidar.") else records.state_topic(vehicle)

    def _vehicle_and_signal(self, name: str) -> tuple[str, Signal]:
        if name not in self.described:
            raise RecordingError(f"signal '{name}' is not known. {suggest(name, list(self.described))}")
        return name.partition("/")[0], self.described[name]

    def _read(self, name: str) -> NDArray[Any]:
        _, signal = self._vehicle_and_signal(name)
        (values,) = self._message(name).columns([self._path(name)], self._messages(self._topic(name)))
        if signal.dtype.kind == "f" or any(value is None for value in values):
            shape: tuple[int, ...] = next((np.shape(value) for value in values if value is not None), ())
            filled = [np.full(shape, np.nan) if value is None else value for value in values]
            if len({np.shape(value) for value in filled}) > 1:
                raise RecordingError(f"signal '{name}' changes its size in the recording; read it from the Frames")
            return np.array(filled, np.float64)
        return np.array(values, signal.dtype)

    def _messages(self, topic: str) -> list[bytes]:
        if topic not in self._data:
            self._data[topic] = self._recording.messages_of(topic)
        return self._data[topic]

    def _message(self, name: str) -> wire.WireMessage:
        """The message that contains a signal."""
        signal = self._vehicle_and_signal(name)[1]
        if isinstance(signal, OwnSignal):
            return self._recording.own_message
        return self._recording.scan_message if signal.name.startswith("lidar.") else self._states.vehicle

    def _path(self, name: str) -> list[str]:
        """Fields of the message, down to a signal."""
        signal = self._vehicle_and_signal(name)[1]
        return ["values"] if isinstance(signal, OwnSignal) else signal.name.removeprefix("lidar.").split(".")


def _arrays(values: Sequence[Any]) -> Iterator[tuple[list[int], NDArray[Any]]]:
    """Places and values of each shape; without those that are missing."""
    places: dict[tuple[int, ...], list[int]] = {}
    for i, value in enumerate(values):
        if value is not None:
            places.setdefault(np.shape(value), []).append(i)
    for rows in places.values():
        yield rows, np.array([values[i] for i in rows])
