"""The rules of a race, as a YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from autodrive.base.specs import Spec

Seconds: TypeAlias = Annotated[float, Field(ge=0.0, le=1e6)]

Signal: TypeAlias = Literal["position", "velocity", "laps", "collisions"]
"""What a script may be denied during a race."""


class RaceRules(Spec):
    """The rules of a race. Times are simulated unless stated otherwise."""

    title: str = ""
    """Title shown in lists and results."""
    warm_up_laps: int = Field(default=0, ge=0, le=1000)
    """Laps before those that count."""
    race_laps: int = Field(default=0, ge=0, le=1000)
    """Laps that count; 0: without limit."""
    checkpoint_distance: float = Field(default=5.0, ge=0.5, le=1000.0)
    """Distance of neighbouring checkpoints along the centre line [m], about; they are equally spaced. A track may have
    checkpoints of its own instead."""
    missed_checkpoint: Literal["required", "made_good"] = "required"
    """'required': a missed checkpoint leaves the lap open until the vehicle passes it. 'made_good': a checkpoint counts
    if the vehicle has just passed the one before, so that passing the next two makes a missed one good."""
    collision_penalty: Seconds = 0.0
    """Added to the time for each collision [s]."""
    collision_limit: int | None = Field(default=None, ge=0, le=10_000)
    """More collisions disqualify; left out: no limit."""
    counts_warm_up_collisions: bool = False
    """Whether collisions before the laps that count are penalised."""
    counts_boxes: bool = True
    """Whether collisions with boxes count, as those with the track."""
    is_set_back: bool = False
    """Whether a collision sets a vehicle back, at rest, to the checkpoint that it passed last."""
    restart_delay: Seconds = 0.0
    """Time for which a vehicle stands after it was set back [s]."""
    vehicle_contact: Literal["none", "behind", "both", "side_by_side", "judged"] = "behind"
    """Who pays for a contact of two vehicles: nobody, the one behind (both if they are side by side), both, both, which
    are set side by side at the checkpoint of the leading one, or whom the six penalties of a head to head name
    (`contacts.py`)."""
    start_delay: Seconds = 0.0
    """Time for which all vehicles stand before the start [s]."""
    time_limit: Seconds | None = None
    """Vehicles that have not finished after this time retire [s]."""
    standstill_limit: Seconds | None = None
    """A vehicle that has not passed a checkpoint for this time retires [s]."""
    wrong_way_limit: float | None = Field(default=None, ge=0.5, le=1e4)
    """A vehicle that drives farther than this against the direction of the track is disqualified [m]."""
    withheld: tuple[Signal, ...] = ()
    """Signals that scripts receive as zeros, and laps as before the first one: true position, true velocity, lap times,
    collisions."""
    on_reset: Literal["allow", "ignore", "disqualify"] = "disqualify"
    """What happens if a script requests a reset or moves its vehicle by co-simulation."""
    silence_limit: Annotated[float, Field(gt=0.0, le=1e6)] = 10.0
    """A script that sends no command for this wall time retires [s]."""

    @property
    def lap_total(self) -> int:
        """Laps with those of the warm-up; 0: without limit."""
        return self.warm_up_laps + self.race_laps if self.race_laps else 0

    def adjusted_time(self, race_time: float, collisions: int) -> float:
        """The time that counts [s]."""
        return race_time + self.collision_penalty * collisions

    def is_disqualified_by(self, collisions: int) -> bool:
        """Whether that many collisions are too many."""
        return self.collision_limit is not None and collisions > self.collision_limit


def load_rules(name: str | Path) -> RaceRules:
    """The rules of that name, or of a YAML file. Raises `SpecError` with all errors."""
    from autodrive.scenario.kinds import read  # noqa: PLC0415  compiling needs no files

    return read("ruleset", name, RaceRules)
