"""What a scenario and its files say: the Specs, which a World is compiled from, and the lines that they come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from autodrive.base.specs import Described, Key
from autodrive.scenario.maps.spec import DescribedMap
from autodrive.scenario.race_rules import RaceRules
from autodrive.scenario.scenario import ScenarioSpec
from autodrive.scenario.tracks.track import TrackSpec
from autodrive.scenario.vehicles.spec import VehicleSpec


@dataclass(frozen=True)
class Specs:
    """All Specs of a scenario. Those of files that are not valid are not there."""

    scenario: ScenarioSpec
    map: DescribedMap
    vehicles: Mapping[str, Described[VehicleSpec]]
    """Files of the vehicles by type, as in the scenario."""
    rules: Described[RaceRules] | None = None
    """Rules of the race; None if there is none."""
    track: Described[TrackSpec] | None = None
    """Track of the race, if it is not the map."""
    own_sensors: Mapping[str, Callable[[], Any] | str] = field(default_factory=dict)
    """Classes of the user's sensors, as the scenario names them; a text: why there is none."""


@dataclass(frozen=True)
class Descriptions:
    """The Specs of a scenario, and where they come from."""

    specs: Specs
    path: str = ""
    """Path of the scenario; empty: it has no file."""
    lines: Mapping[Key, int] = field(default_factory=dict)
    """Lines of the keys in the files 'scenario' and 'map'."""
