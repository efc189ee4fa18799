"""Signals of a recording as arrays."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from autodrive.base.suggest import suggest
from autodrive.protocol.channels import CHANNELS, Signal
from autodrive.recording import mcap, records, wire
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS


class Messages(Protocol):
    """The part of a Recording that is used here."""

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        ...

    @property
    def scan_message(self) -> wire.Message:
        """The message of a scan."""
        ...

    def messages_of(self, topic: str) -> list[bytes]:
        """The data of all messages of a topic."""
        ...

    def log_times(self, topic: str) -> NDArray[np.float64]:
        """Their times [s]."""
        ...

    def blocks(self, topics: Collection[str], start: float, end: float) -> Iterator[dict[str, list[mcap.Message]]]:
        """Messages by topic, for each part of the file from a time to another [s]."""
        ...


class Signals(Mapping[str, NDArray[Any]]):
    """The signals by name: vehicle and signal of `protocol.channels`, such as 'V1/ips/position'.

    The first axis of an array belongs to `times(name)`: the Frames, or for a LIDAR its scans. A missing reading is NaN.
    """

    def __init__(self, recording: Messages, states: records.States) -> None:
        self._recording = recording
        self._states = states
        self._cache: dict[str, NDArray[Any]] = {}
        self._data: dict[str, list[bytes]] = {}
        self.described = {
            f"{vehicle}/{signal.name.replace('.', '/')}": signal
            for vehicle in recording.vehicles
            for channel in CHANNELS
            for signal in channel.signals
        }
        """The signal of each name, with its unit and the names of its elements."""

    def __iter__(self) -> Iterator[str]:
        return iter(self.described)

    def __len__(self) -> int:
        return len(self.described)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Raises `RecordingError` for a name that is not known."""
        if name not in self._cache:
            self._cache[name] = self._read(name)
        return self._cache[name]

    def times(self, name: str) -> NDArray[np.float64]:
        """The time of each value of a signal [s]."""
        return self._recording.log_times(self._topic(name))

    def blocks(self, names: Sequence[str], start: float, end: float) -> Iterator[dict[str, tuple[Any, Any]]]:
        """Times [s] and values of signals by name, for each part of the file from a time to another [s].

        The first and the last part may also contain times outside. Nothing is kept in memory.
        """
        topics: dict[str, dict[str, list[str]]] = {}
        for name in names:
            topics.setdefault(self._topic(name), {})[name] = self._path(name)
        for messages in self._recording.blocks(topics, start, end):
            for topic, of in messages.items():
                times = np.array([one.log_time for one in of]) / NANOSECONDS
                message = self._message(next(iter(topics[topic])))
                columns = message.columns(list(topics[topic].values()), [one.data for one in of])
                for name, column in zip(topics[topic], columns, strict=True):
                    for places, values in _arrays(column):
                        yield {name: (times[places], values)}

    def _topic(self, name: str) -> str:
        vehicle, signal = self._found(name)
        is_scan = signal.name.startswith("lidar.")
        return records.scan_topic(vehicle) if is_scan else records.state_topic(vehicle)

    def _found(self, name: str) -> tuple[str, Signal]:
        if name not in self.described:
            raise RecordingError(f"signal '{name}' is not known. {suggest(name, list(self.described))}")
        return name.partition("/")[0], self.described[name]

    def _read(self, name: str) -> NDArray[Any]:
        _, signal = self._found(name)
        topic = self._topic(name)
        if topic not in self._data:
            self._data[topic] = self._recording.messages_of(topic)
        (found,) = self._message(name).columns([self._path(name)], self._data[topic])
        if signal.dtype.kind == "f" or any(one is None for one in found):
            shape: tuple[int, ...] = next((np.shape(one) for one in found if one is not None), ())
            filled = [np.full(shape, np.nan) if one is None else one for one in found]
            if len({np.shape(one) for one in filled}) > 1:
                raise RecordingError(f"signal '{name}' changes its size in the recording; read it from the Frames")
            return np.array(filled, np.float64)
        return np.array(found, signal.dtype)

    def _message(self, name: str) -> wire.Message:
        """The message that contains a signal."""
        is_scan = self._found(name)[1].name.startswith("lidar.")
        return self._recording.scan_message if is_scan else self._states.vehicle

    def _path(self, name: str) -> list[str]:
        """Fields of the message, down to a signal."""
        return self._found(name)[1].name.removeprefix("lidar.").split(".")


def _arrays(values: Sequence[Any]) -> Iterator[tuple[list[int], NDArray[Any]]]:
    """Places and values of each shape; without those that are missing."""
    places: dict[tuple[int, ...], list[int]] = {}
    for i, value in enumerate(values):
        if value is not None:
            places.setdefault(np.shape(value), []).append(i)
    for found in places.values():
        yield found, np.array([values[i] for i in found])
