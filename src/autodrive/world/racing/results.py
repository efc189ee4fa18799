"""Results of a race, from its Frames: standings, lap table and driven lines, as JSON, Markdown, CSV and a picture."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.texts import with_encodable_texts
from autodrive.protocol.messages import (
    CheckpointPassed,
    Frame,
    LapCompleted,
    RacePenalty,
    RaceState,
    RaceStatus,
    RaceStatusChanged,
)
from autodrive.scenario.tracks import Track
from autodrive.world.racing.picture import driven_lines

COLUMNS = ("Rank", "Team", "Race Time (s)", "Collisions", "Adjusted Time (s)", "Best Lap (s)", "Status")
"""Titles of the columns, as in the standings of the league."""


@dataclass
class Lap:
    """A completed lap; times in simulated seconds."""

    lap: int
    time: float
    is_counted: bool
    sectors: list[float | None]
    """Time from the checkpoint before to each checkpoint; None for one that was missed."""
    penalties: int


@dataclass(frozen=True)
class Standing:
    """The result of one vehicle; times in simulated seconds."""

    rank: int
    vehicle: str
    team: str
    status: str
    """'finished', 'disqualified', 'retired', or 'racing' if the race was stopped."""
    reason: str
    race_time: float
    collisions: int
    penalty: float
    adjusted_time: float
    best_lap: float | None
    """Time of the best lap that counts [s]; None without one."""
    laps: list[Lap]

    @property
    def row(self) -> tuple[str, ...]:
        """The texts of `COLUMNS`; a vehicle that has not finished has no time."""
        has_time = self.status == "finished"
        status = f"{self.status}: {self.reason}" if self.reason else self.status
        return (
            str(self.rank),
            self.team,
            f"{self.race_time:.2f}" if has_time else "",
            str(self.collisions),
            f"{self.adjusted_time:.2f}" if has_time else "",
            f"{self.best_lap:.2f}" if self.best_lap else "",
            status,
        )


@dataclass(frozen=True)
class RaceResult:
    """What a race was, and its standings in the order of ranks."""

    version: str
    track: str
    length: float
    """Length of the centre line [m]."""
    rules: str
    title: str
    """Title of the rules."""
    is_lockstep: bool
    seed: int
    simulated_time: float
    wall_time: float
    ended_by: str
    standings: list[Standing]
    notes: dict[str, str] = field(default_factory=dict)
    """How the script of a vehicle repeats commands in lock-step, and its code that is not in `digests`, by vehicle."""
    recording: str = ""
    """Path of the recording; empty if there is none."""
    digests: dict[str, str] = field(default_factory=dict)
    """SHA-256 of the files of track and rules, and by vehicle of the code of the scripts that the race has started."""

    def to_json(self) -> str:
        """The content of result.json."""
        return json.dumps(with_encodable_texts(asdict(self)), indent=2) + "\n"

    def to_markdown(self) -> str:
        """The content of result.md."""
        pace = "lock-step" if self.is_lockstep else "real time"
        head = f"# {self.title}: {self.track}\n\nTrack of {self.length:.1f} m; {pace}; seed {self.seed}.\n\n"
        notes = "".join(f"\n{vehicle}: {note}.\n" for vehicle, note in self.notes.items())
        return head + _table(COLUMNS, [standing.row for standing in self.standings]) + notes

    def laps_csv(self) -> str:
        """The content of laps.csv: a row for each lap."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        sectors = max((len(lap.sectors) for standing in self.standings for lap in standing.laps), default=0)
        names = (f"sector_{i}" for i in range(1, sectors + 1))
        writer.writerow(("vehicle", "team", "lap", "is_counted", "time", "penalties", *names))
        for standing in self.standings:
            for lap in standing.laps:
                times = ("" if value is None else f"{value:.4f}" for value in (lap.time, *lap.sectors))
                time, *splits = times
                row = standing.vehicle, standing.team, lap.lap, int(lap.is_counted), time, lap.penalties
                writer.writerow((*row, *splits))
        return file.getvalue()


@dataclass
class _Record:
    """What one vehicle has done."""

    laps: list[Lap] = field(default_factory=list)
    sectors: list[float | None] = field(default_factory=list)
    penalties: int = 0
    reason: str = ""
    driven: list[tuple[float, float, float]] = field(default_factory=list)


class RaceRecorder:
    """Sink: collects the laps, penalties and driven lines of a race. A Frame of an earlier time starts it again."""

    def __init__(self) -> None:
        self._records: dict[str, _Record] = {}
        self._frame: Frame | None = None

    def publish(self, frame: Frame) -> None:
        """Add what happened in a tick."""
        if self._frame is None or frame.time < self._frame.time:
            self._records = {name: _Record() for name in frame.vehicles}
        self._frame = frame
        for event in frame.events:
            if isinstance(event, CheckpointPassed | LapCompleted | RacePenalty | RaceStatusChanged):
                _note(self._records[event.vehicle], event)
        for name, vehicle in frame.vehicles.items():
            if vehicle.race is not None and vehicle.race.status == RaceStatus.RACING:
                x, y, _ = vehicle.pose.position.tolist()
                self._records[name].driven.append((x, y, math.hypot(*vehicle.velocity.tolist()[:2])))

    @property
    def is_over(self) -> bool:
        """Whether no vehicle waits or races any more."""
        return self._frame is not None and all(
            state.status not in (RaceStatus.WAITING, RaceStatus.RACING) for state in _states(self._frame).values()
        )

    def standings(self, teams: Sequence[str] | None = None) -> list[Standing]:
        """The vehicles in the order of their ranks.

        `teams`: names in the order of the vehicles, by default the names of the vehicles.
        """
        states = _states(self._frame) if self._frame else {}
        named = dict(zip(states, teams or list(states), strict=True))
        return sorted(
            (_standing(name, named[name], state, self._records[name]) for name, state in states.items()),
            key=lambda standing: standing.rank,
        )

    def driven(self) -> dict[str, Floats]:
        """x, y [m] and speed [m/s] along the way of each vehicle while it raced, shape (n, 3)."""
        return {name: np.array(record.driven).reshape(-1, 3) for name, record in self._records.items()}


def _states(frame: Frame) -> dict[str, RaceState]:
    return {name: vehicle.race for name, vehicle in frame.vehicles.items() if vehicle.race is not None}


def _note(record: _Record, event: CheckpointPassed | LapCompleted | RacePenalty | RaceStatusChanged) -> None:
    match event:
        case CheckpointPassed():
            if (missed := event.checkpoint - 1 - len(record.sectors)) >= 0:  # less: the vehicle has come back to it
                record.sectors += [*[None] * missed, event.sector_time]
        case LapCompleted():
            lap = Lap(event.lap, event.lap_time, event.is_counted, record.sectors, record.penalties)
            record.laps.append(lap)
            record.sectors, record.penalties = [], 0
        case RacePenalty():
            record.penalties += 1
        case RaceStatusChanged():
            record.reason = event.reason


def _standing(name: str, team: str, state: RaceState, record: _Record) -> Standing:
    return Standing(
        rank=state.rank,
        vehicle=name,
        team=team,
        status=state.status.name.lower(),
        reason=record.reason,
        race_time=state.race_time,
        collisions=state.collision_count,
        penalty=state.penalty,
        adjusted_time=state.race_time + state.penalty,
        best_lap=state.best_lap_time if math.isfinite(state.best_lap_time) else None,
        laps=record.laps,
    )


RESULT_FILES = ("result.json", "result.md", "laps.csv", "lines.png")
"""What `write_results` writes."""


def write_results(folder: Path, result: RaceResult, recorder: RaceRecorder, track: Track) -> None:
    """Write `RESULT_FILES` to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = result.to_json(), result.to_markdown(), result.laps_csv(), driven_lines(track, recorder.driven())
    for name, content in zip(RESULT_FILES, contents, strict=True):
        write_file(folder / name, content)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)
