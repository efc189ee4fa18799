"""What drivers and metrics know of a run before it starts."""

from __future__ import annotations

from dataclasses import dataclass

from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import Map
from autodrive.scenario.vehicles.spec import VehicleSpec


@dataclass(frozen=True)
class RunScene:
    """The scenario of a run."""

    scenario: ScenarioSpec
    """The scenario with the parameters and the seed of the run."""
    map: Map
    vehicles: dict[str, VehicleSpec]
    """Vehicles by name."""
    vehicle: str
    """Name of the vehicle that metrics and events are about."""
