"""The places of the vehicles between two Frames that a client gets, ten in each simulated second."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from autodrive.protocol.native import Ways

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.protocol.messages import Frame

PERIOD = 0.1
"""Simulated time between two notes [s]."""
KEPT = 3000
"""Notes that are kept: of the last five minutes."""


class Note(NamedTuple):
    """Where the vehicles were."""

    run: int
    """Number of times that the simulated time went back before."""
    time: float
    positions: dict[str, Floats]


class WayNotes:
    """Notes where the vehicles are. `publish` is called in the thread of the simulation, `between` in another one."""

    def __init__(self) -> None:
        self._notes: deque[Note] = deque(maxlen=KEPT)
        self._run = 0
        self._time = self._due = 0.0

    def publish(self, frame: Frame) -> None:
        """Note the places of a Frame if they are due."""
        if frame.time < self._time:
            self._run += 1
            self._due = 0.0
        self._time = frame.time
        if frame.time >= self._due:
            self._due = frame.time + PERIOD - 1e-9
            positions = {name: vehicle.pose.position for name, vehicle in frame.vehicles.items()}
            self._notes.append(Note(self._run, frame.time, positions))

    def between(self, start: float, end: float) -> Ways | None:
        """The places after the time `start` and before `end` [s], since time went back last; None: there are none."""
        notes: list[Note] = []
        for note in reversed(list(self._notes)):
            if note.run != self._run or note.time <= start:
                break
            if note.time < end:
                notes.append(note)
        if not notes:
            return None
        notes.reverse()
        names = [name for name in notes[-1].positions if all(name in note.positions for note in notes)]
        return Ways(
            np.array([note.time for note in notes]),
            {name: np.concatenate([note.positions[name] for note in notes]) for name in names},
        )
