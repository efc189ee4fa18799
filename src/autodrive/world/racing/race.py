"""Scores a race: positions and collisions of each tick in; laps, times, penalties and events out. No clock, no I/O."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from autodrive.base.arrays import Floats, read_only_copy
from autodrive.base.elementary import atan2
from autodrive.base.jit import resolved
from autodrive.protocol.messages import (
    CheckpointPassed,
    Collision,
    Event,
    LapCompleted,
    RacePenalty,
    RaceState,
    RaceStatus,
    RaceStatusChanged,
    SetBack,
    WrongWay,
)
from autodrive.scenario.race_rules import RaceRules
from autodrive.scenario.tracks import Track
from autodrive.world.racing.checkpoints import advance, gates, progress, start
from autodrive.world.racing.contacts import SIDE_BY_SIDE, ContactJudge

Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m], heading [rad]."""

ROOT = 0.16
"""Distance of the root of the league's car ahead of its rear axle [m]; a set-back places the root."""
TRACK_WIDTH = 0.236
"""Track of the league's car [m]: two cars that have touched stand this far to the left and right of a checkpoint."""
SEPARATE = 4.0 * TRACK_WIDTH
"""Two cars that were set side by side may touch again once they have been farther apart than this [m]."""
SET_BACK_STEP, SET_BACK_SIDE = 0.7, 0.35
"""Distances by which a vehicle is set back farther, or beside the centre line, if its place is taken [m]."""
SET_BACK_PLACES = 10
PARKING_STEP = 0.8
"""Vehicles that are out of the race are parked beside the track, this far apart [m]."""

WAITING, RACING, FINISHED, DISQUALIFIED, RETIRED = RaceStatus
"""Names of a module are found faster than those of an enumeration."""


class Move(NamedTuple):
    """A vehicle that the rules place, at rest, at the first of these poses that is free."""

    vehicle: int
    poses: tuple[Pose, ...]


@dataclass
class Entry:
    """The race of one vehicle."""

    status: RaceStatus = WAITING
    laps: int = 0
    lap_start: float = 0.0
    """Time at which the present lap began [s]."""
    split_start: float = 0.0
    """Time at which the vehicle passed the last checkpoint [s]."""
    count_start: float = math.nan
    """Time at which the laps that count began [s]; not a number: they have not begun."""
    race_time: float = 0.0
    """Time of the race of a vehicle that races no more [s]."""
    last_lap: float = math.inf
    best_lap: float = math.inf
    penalty: float = 0.0
    collisions: int = 0
    gap: float = 0.0
    travelled: float = 0.0
    """`Progress.travelled` at the checkpoint that it passed last [m]."""
    lap_travelled: float = 0.0
    """`Progress.travelled` at the beginning of the present lap [m]."""
    held_until: float = -math.inf
    """Time until which the vehicle stands after a set-back [s]."""


class Race:
    """The race of the vehicles of one world.

    `judge` is called once in a tick. The reference point of a vehicle is the centre of its rear axle.
    """

    def __init__(
        self, names: Sequence[str], track: Track, rules: RaceRules, tick: float, boxes: Collection[str] = ()
    ) -> None:
        """`tick` [s]: duration of a tick; `boxes`: names of the objects that do not belong to the track."""
        self.track = track
        self.rules = rules
        self._names = list(names)
        self._tick = tick
        limits = rules.time_limit, rules.standstill_limit, rules.wrong_way_limit
        self._has_limits = any(limit is not None for limit in limits)
        self._gates = gates(track, rules.checkpoint_distance)
        self._lap_total = rules.lap_total
        self._boxes = frozenset(boxes)
        self._gates_at = [*self._gates[:, 6].tolist(), track.length]
        """Distance of each checkpoint along the centre line, and the length of a lap [m]."""
        self._entries = [Entry() for _ in names]
        self._progress = progress(len(self._names))
        self._contacts: ContactJudge | None = None
        if rules.vehicle_contact == "judged" and len(names) > 1:
            self._contacts = ContactJudge(track, len(names), tick)
        self._first_at: dict[tuple[int, int], float] = {}
        """When the first vehicle passed a checkpoint, by lap and checkpoint."""
        self._side_by_side: set[tuple[int, int]] = set()
        """Pairs of vehicles that were set side by side and have not been apart since."""
        line, positions = track.line, np.zeros((len(self._names), 3))
        self._start = resolved(start, line, positions, 0, self._progress)
        self._advance = resolved(advance, line, self._gates, positions, tick, self._progress)

    @property
    def identity(self) -> str:
        """Text that differs between different races."""
        return repr((self.track.name, self.track.centre_line.tolist(), self._gates.tolist(), self.rules.model_dump()))

    @property
    def checkpoints(self) -> int:
        """Number of checkpoints of a lap, with the finish line."""
        return len(self._gates)

    @property
    def is_over(self) -> bool:
        """Whether no vehicle waits or races any more."""
        return all(entry.status not in (WAITING, RACING) for entry in self._entries)

    # -- state --------------------------------------------------------------------------------------------------

    def reset(self, positions: Floats) -> None:
        """Start again from these positions [m], shape (n_vehicle, 3)."""
        self._entries = [Entry() for _ in self._names]
        self._first_at, self._side_by_side = {}, set()
        for column in self._progress:
            column[:] = 0
        if self._contacts is not None:
            self._contacts.reset()
        for i in range(len(self._names)):
            self.moved(i, positions)
            self._entries[i].lap_travelled = float(self._progress.travelled[i])
        if self.rules.start_delay == 0.0:
            for entry in self._entries:
                entry.status = RACING
                entry.count_start = 0.0 if self.rules.warm_up_laps == 0 else math.nan

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        columns = tuple(column.copy() for column in self._progress)
        contacts = self._contacts and self._contacts.save()
        entries = [replace(entry) for entry in self._entries]
        return entries, columns, dict(self._first_at), set(self._side_by_side), contacts

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        entries, columns, first_at, side_by_side, contacts = saved
        self._first_at, self._side_by_side = dict(first_at), set(side_by_side)
        self._entries = [replace(entry) for entry in entries]
        for column, kept in zip(self._progress, columns, strict=True):
            column[:] = kept
        if self._contacts is not None:
            self._contacts.restore(contacts)

    # -- the tick -----------------------------------------------------------------------------------------------

    def restrain(self, time: float, throttle: Floats) -> None:
        """Let the vehicles brake that must stand at that time [s]: writes their `throttle`."""
        for i, entry in enumerate(self._entries):
            if entry.status in (WAITING, DISQUALIFIED, RETIRED) or time < entry.held_until:
                throttle[i] = 0.0

    def judge(self, time: float, positions: Floats, happened: Sequence[Event]) -> tuple[list[Event], list[Move]]:
        """Events and moves of the tick that ended at `time` [s] with these positions [m], shape (n_vehicle, 3).

        `happened`: the events of the rules in this tick. After a move, call `moved`.
        """
        events: list[Event] = []
        moves: list[Move] = []
        if self._entries[0].status == WAITING and time >= self.rules.start_delay:
            events += self._begin(time, positions)
        if self._advance(self.track.line, self._gates, positions, self._tick, self._progress):
            events += self._passed(time, positions)
        if self._contacts is not None:
            self._contacts.note(time, self._progress.s, self._progress.lateral)
        for pair in tuple(self._side_by_side):
            if math.dist(*(positions[i, :2] for i in pair)) > SEPARATE:
                self._side_by_side.discard(pair)
        if happened:
            self._collide(time, positions, happened, events, moves)
        self._check_limits(time, positions, events, moves)
        return events, moves

    def moved(self, i: int, positions: Floats) -> None:
        """Vehicle i has been placed elsewhere."""
        self._start(self.track.line, positions, i, self._progress)
        if self._contacts is not None:
            self._contacts.placed(i)
        self._entries[i].travelled = float(self._progress.travelled[i]) - self._ahead(i)

    def end(self, i: int, status: RaceStatus, reason: str, time: float, positions: Floats) -> tuple[Event, list[Move]]:
        """End the race of vehicle i; of several vehicles, it is parked beside the track unless it has finished."""
        entry = self._entries[i]
        if not math.isnan(entry.count_start):
            entry.race_time = time - entry.count_start
        entry.status = status
        event = RaceStatusChanged(time, self._names[i], status, reason, read_only_copy(positions[i]))
        is_parked = status != FINISHED and len(self._names) > 1
        return event, [Move(i, (self._parking(i),))] if is_parked else []

    def status(self, i: int) -> RaceStatus:
        """The status of vehicle i."""
        return self._entries[i].status

    def states(self, time: float) -> list[RaceState]:
        """The state of each vehicle at that time [s], for a Frame."""
        p = self._progress
        checkpoints = p.counted.tolist()
        distances = list(map(self._distance, self._entries, checkpoints, p.travelled.tolist()))
        ranks, is_wrong_way = self._ranks(distances), p.is_wrong_way.tolist()
        states: list[RaceState] = []
        for i, entry in enumerate(self._entries):
            lap_time, race_time, rank = 0.0, entry.race_time, ranks[i]
            if entry.status == RACING:
                lap_time, since = time - entry.lap_start, entry.count_start
                race_time = 0.0 if math.isnan(since) else time - since
            states.append(
                RaceState(
                    status=entry.status,
                    lap_count=entry.laps,
                    lap_total=self._lap_total,
                    lap_time=lap_time,
                    last_lap_time=entry.last_lap,
                    best_lap_time=entry.best_lap,
                    race_time=race_time,
                    penalty=entry.penalty,
                    collision_count=entry.collisions,
                    checkpoint=checkpoints[i],
                    distance=distances[i],
                    rank=rank,
                    gap=0.0 if rank == 1 else entry.gap,
                    is_wrong_way=is_wrong_way[i] == 1,
                )
            )
        return states

    # -- parts of a tick ----------------------------------------------------------------------------------------

    def _begin(self, time: float, positions: Floats) -> list[Event]:
        events: list[Event] = []
        for i, entry in enumerate(self._entries):
            entry.status = RACING
            entry.lap_start = entry.split_start = self.rules.start_delay
            if self.rules.warm_up_laps == 0:
                entry.count_start = self.rules.start_delay
            events.append(RaceStatusChanged(time, self._names[i], entry.status, "", read_only_copy(positions[i])))
        return events

    def _passed(self, time: float, positions: Floats) -> list[Event]:
        """Events of the vehicles that passed a checkpoint or turned the wrong way in this tick."""
        events: list[Event] = []
        p = self._progress
        for i, entry in enumerate(self._entries):
            if entry.status != RACING:
                continue
            if (gate := int(p.crossed[i])) >= 0:
                events += self._cross(i, entry, gate, time - (1.0 - float(p.passed[i])) * self._tick, positions)
            if p.has_turned[i]:
                events.append(WrongWay(time, self._names[i], read_only_copy(positions[i])))
        return events

    def _cross(self, i: int, entry: Entry, gate: int, time: float, positions: Floats) -> list[Event]:
        """Vehicle i has crossed a checkpoint forward: the events, if it counts."""
        p = self._progress
        count, left = int(p.counted[i]), int(p.left[i])
        p.left[i] = gate
        if gate and self.rules.missed_checkpoint == "made_good":
            is_passed = left == gate - 1
        else:
            is_passed = count == (gate or len(self._gates)) - 1
        # a vehicle that reverses over the finish line and returns has not driven a lap
        is_round = gate > 0 or p.travelled[i] - entry.lap_travelled > 0.5 * self.track.length
        if not (is_passed and is_round):
            return []
        p.counted[i] = gate
        entry.travelled = float(p.travelled[i]) - self._ahead(i)
        return self._pass(i, entry, gate, time, positions) if gate > count or gate == 0 else []

    def _pass(self, i: int, entry: Entry, gate: int, time: float, positions: Floats) -> list[Event]:
        number = gate or len(self._gates)
        lap, name, place = entry.laps + 1, self._names[i], read_only_copy(positions[i])
        split, sector = time - entry.lap_start, time - entry.split_start
        events: list[Event] = [CheckpointPassed(time, name, lap, number, split, sector, place)]
        entry.split_start = time
        entry.gap = time - self._first_at.setdefault((lap, number), time)
        if gate == 0:
            events += self._complete_lap(i, entry, time, positions)
        return events

    def _complete_lap(self, i: int, entry: Entry, time: float, positions: Floats) -> list[Event]:
        rules = self.rules
        entry.laps += 1
        entry.last_lap = time - entry.lap_start
        entry.lap_start = time
        entry.lap_travelled = float(self._progress.travelled[i])
        is_counted = entry.laps > rules.warm_up_laps
        if is_counted:
            entry.best_lap = min(entry.best_lap, entry.last_lap)
        name, place = self._names[i], read_only_copy(positions[i])
        events: list[Event] = [LapCompleted(time, name, entry.laps, entry.last_lap, is_counted, place)]
        if entry.laps == rules.warm_up_laps:
            entry.count_start = time
        if rules.lap_total and entry.laps == rules.lap_total:
            event, _ = self.end(i, FINISHED, "", time, positions)
            events.append(event)
        return events

    def _collide(
        self, time: float, positions: Floats, happened: Sequence[Event], events: list[Event], moves: list[Move]
    ) -> None:
        faults: dict[int, tuple[str, int, float]] = {}
        """Reason, checkpoint at which the vehicle will stand, and how far to the left of it [m], by vehicle."""
        for event in happened:
            if not isinstance(event, Collision) or (event.other in self._boxes and not self.rules.counts_boxes):
                continue
            i = self._names.index(event.vehicle)
            if self._entries[i].status != RACING:
                continue
            if self.rules.vehicle_contact == "side_by_side" and event.other in self._names:
                j = self._names.index(event.other)
                faults |= {k: (f"collision with {self._names[i + j - k]}", *place) for k, place in self._beside(i, j)}
            elif fault := self._fault(i, event.other):
                faults.setdefault(i, (f"{fault} with {event.other}", self._checkpoint(i), 0.0))
        for i, (reason, checkpoint, side) in faults.items():
            self._penalise(i, reason, time, positions, events, moves)
            if self.rules.is_set_back and self._entries[i].status == RACING:
                self._set_back(i, checkpoint, side, time, positions, events, moves)

    def _fault(self, i: int, other: str) -> str:
        """What vehicle i pays for in its contact with `other`; empty if it does not pay."""
        if other not in self._names:
            return "collision"
        j = self._names.index(other)
        if self._contacts is not None:
            name, guilty = self._contacts.fault(i, j)
            return f"{name}: contact" if i in guilty else ""
        ahead = self._distance_along(j) - self._distance_along(i)
        ahead -= self.track.length * round(ahead / self.track.length)
        rule = self.rules.vehicle_contact
        return "collision" if rule == "both" or (rule == "behind" and ahead > -SIDE_BY_SIDE) else ""

    def _beside(self, i: int, j: int) -> list[tuple[int, tuple[int, float]]]:
        """Where two vehicles that touch are set side by side: checkpoint and how far to the left of it [m] of each.

        Empty if this contact does not count.
        """
        pair = min(i, j), max(i, j)
        if pair in self._side_by_side or self._entries[j].status != RACING:
            return []
        self._side_by_side.add(pair)
        leading = max(pair, key=lambda k: (self._entries[k].laps, self._checkpoint(k)))
        left = max(pair, key=lambda k: float(self._progress.lateral[k]))
        return [(k, (self._checkpoint(leading), TRACK_WIDTH if k == left else -TRACK_WIDTH)) for k in pair]

    def _penalise(
        self, i: int, reason: str, time: float, positions: Floats, events: list[Event], moves: list[Move]
    ) -> None:
        entry, rules, name = self._entries[i], self.rules, self._names[i]
        if not rules.counts_warm_up_collisions and entry.laps < rules.warm_up_laps:
            return
        entry.collisions += 1
        entry.penalty = rules.adjusted_time(0.0, entry.collisions)
        if rules.collision_penalty:
            events.append(RacePenalty(time, name, reason, rules.collision_penalty, read_only_copy(positions[i])))
        if rules.is_disqualified_by(entry.collisions):
            why = f"more than {rules.collision_limit} collisions"
            event, parked = self.end(i, DISQUALIFIED, why, time, positions)
            events.append(event)
            moves += parked

    def _set_back(
        self,
        i: int,
        checkpoint: int,
        side: float,
        time: float,
        positions: Floats,
        events: list[Event],
        moves: list[Move],
    ) -> None:
        """Let vehicle i stand at a checkpoint, or so far to the left of it [m]."""
        entry = self._entries[i]
        events.append(SetBack(time, self._names[i], checkpoint, read_only_copy(positions[i])))
        entry.held_until = time + self.rules.restart_delay
        if self._contacts is not None:
            self._contacts.set_back(i, entry.held_until)
        moves.append(Move(i, self._set_back_poses(checkpoint, side)))

    def _check_limits(self, time: float, positions: Floats, events: list[Event], moves: list[Move]) -> None:
        rules, p = self.rules, self._progress
        if not self._has_limits:
            return
        for i, entry in enumerate(self._entries):
            if entry.status != RACING:
                continue
            status, reason = RETIRED, ""
            if rules.time_limit is not None and time >= rules.time_limit:
                reason = f"not finished after {rules.time_limit:g} s"
            elif rules.standstill_limit is not None and time - entry.split_start >= rules.standstill_limit:
                reason = f"no checkpoint for {rules.standstill_limit:g} s"
            elif rules.wrong_way_limit is not None and p.farthest[i] - p.backmost[i] > rules.wrong_way_limit:
                status, reason = DISQUALIFIED, f"more than {rules.wrong_way_limit:g} m the wrong way"
            if reason:
                event, parked = self.end(i, status, reason, time, positions)
                events.append(event)
                moves += parked

    # -- places -------------------------------------------------------------------------------------------------

    def _checkpoint(self, i: int) -> int:
        """Number of the checkpoint that vehicle i has passed last in its lap; 0: the start line."""
        return int(self._progress.counted[i])

    def _distance_along(self, i: int) -> float:
        return float(self._progress.s[i])

    def _distance(self, entry: Entry, passed: int, travelled: float) -> float:
        """Distance along the track since the start line [m]; a checkpoint that was missed holds it."""
        at, following = self._gates_at[passed : passed + 2]
        return entry.laps * self.track.length + at + min(travelled - entry.travelled, following - at)

    def _ahead(self, i: int) -> float:
        """Distance of vehicle i from the checkpoint that it passed last, along the track; half a lap at most [m]."""
        length = self.track.length
        ahead = self._distance_along(i) - self._gates_at[self._checkpoint(i)]
        return ahead - length * round(ahead / length)

    def _ranks(self, distances: Sequence[float]) -> list[int]:
        """Place of each vehicle, from 1."""
        if len(distances) == 1:
            return [1]
        order = sorted(range(len(distances)), key=lambda i: self._order(i, distances[i]))
        ranks = [0] * len(order)
        for place, i in enumerate(order, start=1):
            ranks[i] = place
        return ranks

    def _order(self, i: int, distance: float) -> tuple[int, float, float]:
        """Sorts the vehicles: those that have finished by time, ties by best lap; the others by distance."""
        entry = self._entries[i]
        if entry.status == FINISHED:
            return 0, entry.race_time + entry.penalty, entry.best_lap
        return (2 if entry.status == RETIRED else 3 if entry.status == DISQUALIFIED else 1), -distance, 0.0

    def _set_back_poses(self, checkpoint: int, side: float) -> tuple[Pose, ...]:
        """A checkpoint, or a place so far to the left of it [m]; then places behind and beside that."""
        x, y, dx, dy, *_, at = self._gates[checkpoint].tolist()
        own = x - ROOT * dx - side * dy, y - ROOT * dy + side * dx, atan2(dy, dx)
        return own, *(
            self.track.pose_at(at - ROOT - SET_BACK_STEP * back, beside)
            for back in range(SET_BACK_PLACES)
            for beside in (0.0, SET_BACK_SIDE, -SET_BACK_SIDE)
        )

    def _parking(self, i: int) -> Pose:
        """A place outside the walls."""
        points = np.vstack([*self.track.walls, *self.track.edges])
        x, y = points.min(axis=0)
        return float(x) + PARKING_STEP * i, float(y) - 1.0, 0.0
