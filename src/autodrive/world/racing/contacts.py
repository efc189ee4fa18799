"""Judges a contact of two vehicles by the six penalties of the league's head to head.

The league names them and leaves their meaning to a marshal. These definitions use only where both vehicles were in the
last seconds, along the track and beside its centre line; the limits are chosen for cars of 0.5 m x 0.28 m.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

from autodrive.base.arrays import Floats
from autodrive.scenario.tracks import Track

CAR_LENGTH, CAR_WIDTH = 0.5, 0.28
"""Length and width of a 1:10 race car [m]."""
SIDE_BY_SIDE = 0.25
"""Two vehicles are side by side if they are at most this far apart along the track [m]."""
REJOIN_TIME = 2.0
"""A vehicle rejoins for this time after a set-back or an excursion beyond the edge of the track [s]."""
MOVE_TIME, MOVE = 0.5, 0.15
"""A lateral movement is this large [m], in this time before the contact [s]."""
CORNER_RADIUS = 4.0
"""The track is a corner where its radius is smaller [m]."""
CORNER_EXIT = 2.0
"""The exit of a corner is its second half and this distance after it [m]."""
HISTORY = 4.0
"""Time that is remembered [s]."""

_STEP = 0.1
_CURVATURE_WINDOW = 1.0
"""Lengths by which corners are found [m]."""


class Fault(NamedTuple):
    """The name of a penalty, and the vehicles that pay."""

    name: str
    vehicles: tuple[int, ...]


class _TrackPlaces(NamedTuple):
    """Where all vehicles are on the track at the end of a tick, shape (n_vehicle,) each."""

    time: float
    """Simulated time [s]."""
    s: Floats
    """Distance of each vehicle along the centre line [m]."""
    lateral: Floats
    """How far each vehicle is to the left of the centre line [m]."""


class _Corner(NamedTuple):
    entry: float
    """Distance along the centre line [m]."""
    length: float
    side: float
    """1 for a left turn, -1 for a right turn."""


class ContactJudge:
    """Remembers where the vehicles were, and judges their contacts."""

    def __init__(self, track: Track, vehicles: int, tick: float) -> None:
        """`tick` [s]: duration of a tick."""
        self._track = track
        self._moments: deque[_TrackPlaces] = deque(maxlen=math.ceil(HISTORY / tick) + 1)
        self._since = [-math.inf] * vehicles
        """When each vehicle was last placed elsewhere [s]."""
        self._free = [-math.inf] * vehicles
        """When each vehicle could drive on after its last set-back [s]."""

    def reset(self) -> None:
        """Forget everything."""
        self._moments.clear()
        self._since = [-math.inf] * len(self._since)
        self._free = [-math.inf] * len(self._free)

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return list(self._moments), list(self._since), list(self._free)

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        moments, since, free = saved
        self._moments.clear()
        self._moments.extend(moments)
        self._since, self._free = list(since), list(free)

    def note(self, time: float, s: Floats, lateral: Floats) -> None:
        """The places of all vehicles at the end of a tick: along the centre line, and to the left of it [m]."""
        self._moments.append(_TrackPlaces(time, s.copy(), lateral.copy()))

    def placed(self, i: int) -> None:
        """Vehicle i is placed elsewhere: where it was before does not count."""
        self._since[i] = self._moments[-1].time if self._moments else -math.inf

    def set_back(self, i: int, free: float) -> None:
        """Vehicle i was set back, and may drive from the time `free` [s] on."""
        self._free[i] = free

    def fault(self, first: int, second: int) -> Fault:
        """Who pays for a contact of two vehicles in the latest tick, and for what."""
        now = self._moments[-1]
        gap = self._gap(now, first, second)
        behind, ahead = (first, second) if gap > 0.0 else (second, first)
        rejoining = [i for i in (first, second) if self._rejoins(i, now)]
        if len(rejoining) == 1:
            return Fault("unsafe rejoin", (rejoining[0],))
        corner = self._corner(float(now.s[ahead]))
        if (diving := self._diving(now, first, second, corner)) is not None:
            return Fault("late-braking dive", (diving,))
        moved = [i for i, other in ((first, second), (second, first)) if self._moved_towards(now, i, other)]
        is_beside = abs(gap) <= SIDE_BY_SIDE
        if len(moved) == 1 and (is_beside or moved[0] == ahead):
            other = first + second - moved[0]
            is_squeeze = is_beside and self._is_squeeze(now, moved[0], other)
            return Fault("squeeze at the exit of a corner" if is_squeeze else "unsafe lateral movement", (moved[0],))
        return Fault("shared incident", (first, second)) if is_beside else Fault("rear end", (behind,))

    # -- parts of the judgement ------------------------------------------------------------------------------------

    def _gap(self, at: _TrackPlaces, first: int, second: int) -> float:
        """How far the second vehicle is ahead of the first along the track; half a lap at most [m]."""
        return self._ahead(float(at.s[first]), float(at.s[second]))

    def _ahead(self, start: float, end: float) -> float:
        length = self._track.length
        return end - start - length * round((end - start) / length)

    def _rejoins(self, i: int, now: _TrackPlaces) -> bool:
        """Whether vehicle i has just driven on after a set-back, or was beyond an edge of the track."""
        if 0.0 <= now.time - self._free[i] <= REJOIN_TIME:
            return True
        return any(
            self._is_outside(float(moment.s[i]), float(moment.lateral[i]))
            for moment in self._back(now.time - REJOIN_TIME, i)
        )

    def _is_outside(self, s: float, lateral: float) -> bool:
        right, left = self._track.widths_at(s)
        return not -right <= lateral <= left

    def _diving(self, now: _TrackPlaces, first: int, second: int, corner: _Corner | None) -> int | None:
        """The vehicle that touches from the inside of a corner and had no overlap when the first of both entered it."""
        apart = float(now.lateral[first] - now.lateral[second])
        if corner is None or abs(apart) < 0.5 * CAR_WIDTH:
            return None
        inside, outside = (first, second) if apart * corner.side > 0.0 else (second, first)
        for moment in self._back(-math.inf, first, second):
            into = max(self._ahead(corner.entry, float(moment.s[i])) for i in (first, second))
            if into < 0.0:
                return inside if self._gap(moment, inside, outside) >= CAR_LENGTH else None
        return None

    def _moved_towards(self, now: _TrackPlaces, i: int, other: int) -> bool:
        """Whether vehicle i has moved into the way of the other, from a place where they would not have touched."""
        *_, before = now, *self._back(now.time - MOVE_TIME, i, other)
        apart = float(before.lateral[other] - before.lateral[i])
        moved = float(now.lateral[i] - before.lateral[i])
        return abs(apart) >= CAR_WIDTH and moved * math.copysign(1.0, apart) >= MOVE

    def _is_squeeze(self, now: _TrackPlaces, mover: int, other: int) -> bool:
        """Whether the mover comes from the inside of a corner, at its exit, to the other on the outside."""
        s = float(now.s[mover])
        corner = self._corner(s)
        for step in range(round(CORNER_EXIT / _STEP)):
            corner = corner or self._corner(s - _STEP * step)
        if corner is None or self._ahead(corner.entry, s) < 0.5 * corner.length:
            return False
        return float(now.lateral[mover] - now.lateral[other]) * corner.side > 0.0

    def _back(self, until: float, *vehicles: int) -> Iterator[_TrackPlaces]:
        """The moments from the latest one back to a time [s], and not beyond the last placing of these vehicles."""
        placed = max(self._since[i] for i in vehicles)
        for moment in reversed(self._moments):
            if moment.time < until - 1e-9 or moment.time <= placed:  # times are multiples of the tick, but for rounding
                return
            yield moment

    # -- corners ---------------------------------------------------------------------------------------------------

    def _corner(self, s: float) -> _Corner | None:
        """The corner at a distance along the centre line [m]; None on a straight."""
        side = self._turn(s)
        if side == 0.0:
            return None
        steps = round(self._track.length / _STEP)
        back = next((n for n in range(1, steps) if self._turn(s - _STEP * n) != side), steps)
        front = next((n for n in range(1, steps) if self._turn(s + _STEP * n) != side), steps)
        return _Corner(s - _STEP * back, _STEP * (back + front), side)

    def _turn(self, s: float) -> float:
        """1 in a left turn, -1 in a right turn, 0 on a straight."""
        half = 0.5 * _CURVATURE_WINDOW
        turned = self._track.pose_at(s + half)[2] - self._track.pose_at(s - half)[2]
        curvature = math.remainder(turned, math.tau) / _CURVATURE_WINDOW
        return 0.0 if abs(curvature) < 1.0 / CORNER_RADIUS else math.copysign(1.0, curvature)
