"""Snapshots: the saved state of a World, and the check that a snapshot fits a world."""

from __future__ import annotations

import hashlib
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.errors import SnapshotError
from autodrive.physics.model import Table
from autodrive.physics.weather import ChangingWeather
from autodrive.protocol.messages import Frame
from autodrive.scenario.maps.light_programs import all_programs
from autodrive.world.columns import Worlds, columns_of, each_column
from autodrive.world.compile import CompiledScenario


class Snapshot(NamedTuple):
    """The saved state of a World."""

    world: str
    """Identity of the world, the same for all worlds that the snapshot fits."""
    seed: int
    row: Worlds
    """Numbers of the World; see `columns.saved_row`."""
    weather: ChangingWeather
    parts: dict[str, Any]
    """What the parts of the World have saved that are not in its row, by name."""
    frame: Frame


def identity(c: CompiledScenario, wheels: Table) -> str:
    """Hash of everything that a snapshot must have in common with a world; `wheels`: on a dry road."""
    tables = c.model.vehicles.tolist(), wheels.tolist()
    parts = c.engine.identity, c.spec.tick, c.spec.command_timeout, c.configured, tables, c.sensors.noise_factors
    race = c.race.identity if c.race else ""
    if c.spec.traffic.cars:
        traffic = c.spec.traffic.model_copy(update={"type": ""})  # a name or a file; the tables have its values
        parts = *parts, traffic, [lane.points.tolist() for lane in c.map.lane_graph.lanes]
    if c.map.traffic_lights:
        parts = *parts, all_programs(c.map.light_programs, c.spec.light_programs), c.map.traffic_lights
    if c.spec.v2x is not None:
        parts = *parts, c.spec.v2x
    return hashlib.sha256(repr(parts).encode() + race.encode() + c.map.drivable_edges.tobytes()).hexdigest()


def check_snapshot(saved: object, world: str, map_: str, row: Worlds, has_images: bool) -> None:
    """Raises `SnapshotError` unless it is a snapshot that fits the world with this identity, map and row.

    `has_images`: the world has cameras whose images a snapshot holds.
    """
    if not isinstance(saved, Snapshot):
        raise SnapshotError(f"restore() needs a Snapshot, which save() returns, not {type(saved).__name__}")
    if saved.world != world:
        raise SnapshotError(
            "the snapshot is of another world: scenario, vehicles, map, sensors and version of the engine must be "
            f"the same as in this world of map '{map_}'"
        )
    try:
        fits = each_column(lambda kept, own: kept.shape == own.shape and kept.dtype == own.dtype, saved.row, row)
        is_same = all(columns_of(fits))
    except (AttributeError, TypeError, ValueError):
        is_same = False
    if not is_same:
        raise SnapshotError("the state of the snapshot has other shapes than that of this world")
    if not np.isfinite(np.frombuffer(b"".join([column.tobytes() for column in saved.row.state]))).all():
        raise SnapshotError("the state of the snapshot has numbers that are not finite")
    if has_images and saved.parts.get("cameras") is None:
        raise SnapshotError("the snapshot is of a world without cameras; save it in a world with cameras")
