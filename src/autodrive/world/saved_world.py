"""The state of a World as bytes without code, for a recording that begins in the middle of a run."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from autodrive.base.errors import SnapshotError
from autodrive.physics.weather import ChangingWeather
from autodrive.world.columns import Worlds, columns_of, each_column, without_tables
from autodrive.world.controls import VehicleControls
from autodrive.world.poses import Held
from autodrive.world.snapshot import Snapshot

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.world.world import World

MAX_SIZE = 2**28
"""Most bytes of a state that is read."""


class Column(msgspec.Struct, frozen=True, array_like=True):
    """An array of numbers: type as numpy names it, shape, and content."""

    dtype: str
    shape: tuple[int, ...]
    data: bytes


class SavedWorld(msgspec.Struct, frozen=True):
    """A `Snapshot` without its Frame."""

    world: str
    seed: int
    columns: Sequence[Column]
    weather: ChangingWeather
    controls: list[VehicleControls]
    held: dict[str, Held]


def saved(world: World) -> bytes | None:
    """The state of a World; None for a race, and for sensors of the user, whose state may contain code."""
    if world.race is not None or world.compiled.own_sensors.placed:
        return None
    snapshot = world.save()
    columns = [Column(column.dtype.str, column.shape, column.tobytes()) for column in columns_of(snapshot.row)]
    parts = snapshot.parts
    state = SavedWorld(
        snapshot.world, snapshot.seed, columns, snapshot.weather, list(parts["controls"]), dict(parts["poses"])
    )
    return zlib.compress(msgspec.msgpack.encode(state), 1)


def restore(world: World, data: bytes, frame: Frame) -> None:
    """Let a World go on from what `saved` returned; `frame`: that of the World that was saved.

    Raises `SnapshotError` for damaged data, and for the state of another World; then nothing has changed.
    """
    unpacker = zlib.decompressobj()
    try:
        plain = unpacker.decompress(data, MAX_SIZE)
        if not unpacker.eof:
            raise ValueError("its end is missing")
        state = msgspec.msgpack.decode(plain, type=SavedWorld)
        columns = iter(state.columns)
        row: Worlds = each_column(lambda own: _array(next(columns), own), without_tables(world.row.rows.worlds))
        if next(columns, None) is not None:
            raise ValueError("it has too many arrays")
    except (zlib.error, msgspec.DecodeError, ValueError, TypeError, StopIteration, RuntimeError) as error:
        raise SnapshotError(f"the saved state is damaged: {error}") from None
    parts: dict[str, Any] = {"controls": state.controls, "poses": state.held, "own_sensors": {}, "cameras": None}
    world.restore(Snapshot(state.world, state.seed, row, state.weather, parts, frame))


def _array(column: Column, own: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The array, with the type of that of the World."""
    if column.dtype != own.dtype.str:
        raise ValueError(f"an array has values of the type {column.dtype}, not {own.dtype.str}")
    return np.frombuffer(column.data, own.dtype).reshape(column.shape)
