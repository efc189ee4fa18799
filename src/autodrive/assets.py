"""What a world looks like: the assets of its map, vehicles and boxes, built once on a machine and kept as files."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel
from shapely.geometry.base import BaseGeometry

from autodrive.cache import cache_folder
from autodrive.render.asset import Asset
from autodrive.render.glb import read_glb, write_glb
from autodrive.render.scene import Scene

if TYPE_CHECKING:
    from autodrive.maps.map import Map
    from autodrive.maps.solids import BoxPlacement
    from autodrive.vehicles.spec import VehicleSpec


Kind = Literal["vehicle", "map", "box"]


class Drawable(Protocol):
    """What is needed of a compiled scenario to draw it."""

    @property
    def map(self) -> Map:
        """Where it is."""
        ...

    @property
    def vehicles(self) -> Mapping[str, VehicleSpec]:
        """By name, in the order of a Moment's rows."""
        ...

    @property
    def boxes(self) -> Sequence[BoxPlacement]:
        """Movable things, likewise in order."""
        ...


def scene_of(world: Drawable) -> Scene:
    """All there is to draw of a world; what is equal is held once."""
    known: dict[str, Asset] = {}

    def shared(kind: Kind, of: Any) -> Asset:
        name = _file_name(kind, of)
        if name not in known:
            known[name] = kept(name, lambda: _build(kind, of))
        return known[name]

    return Scene(
        static=shared("map", world.map),
        vehicles=[shared("vehicle", spec) for spec in world.vehicles.values()],
        objects=[shared("box", box.size) for box in world.boxes],
        lights=[spec.lights for spec in world.vehicles.values()],
    )


def vehicle(spec: VehicleSpec) -> Asset:
    """How that vehicle looks."""
    return _asset("vehicle", spec)


def ground(map_: Map) -> Asset:
    """How all of that map looks that does not move."""
    return _asset("map", map_)


def box(size: tuple[float, float, float]) -> Asset:
    """How a box of that length, width and height [m] looks."""
    return _asset("box", size)


def file(kind: Kind, of: Any) -> tuple[str, bytes]:
    """Name and content of the .glb file of a vehicle (its spec), a map or a box (its size); same name, same content."""
    name = _file_name(kind, of)
    return name, _kept(name, lambda: _build(kind, of))[1]


def kept(name: str, build: Callable[[], Asset]) -> Asset:
    """The asset that `build` makes, read from the file of that name if it was built before.

    A file that is damaged is built anew; where nothing can be kept, the asset is just built.
    """
    return _kept(name, build)[0]


def _kept(name: str, build: Callable[[], Asset]) -> tuple[Asset, bytes]:
    """The asset, and its file's content."""
    path = _folder() / name
    with contextlib.suppress(OSError, ValueError):
        data = path.read_bytes()
        return read_glb(data), data
    data = write_glb(build())
    with contextlib.suppress(OSError):
        _write(path, data)
    return read_glb(data), data  # as the next start will have it: a texture has been through its JPEG


@cache
def _folder() -> Path:
    makers = " ".join(version(name) for name in ("numpy", "shapely", "trimesh", "manifold3d", "simplejpeg"))
    return cache_folder("assets", "render", "vehicles", "maps", also=makers)


def _write(path: Path, data: bytes) -> None:
    """Whole or not at all: whoever reads meanwhile finds no half of a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, part = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(part).replace(path)
    except OSError:
        Path(part).unlink(missing_ok=True)
        raise


def _asset(kind: Kind, of: Any) -> Asset:
    return kept(_file_name(kind, of), lambda: _build(kind, of))


def _build(kind: Kind, of: Any) -> Asset:
    """Where all comes from the cache, what builds is not even imported: it takes longer than reading."""
    if kind == "vehicle":
        from autodrive.vehicles.mesh import vehicle_asset

        return vehicle_asset(of)
    from autodrive.maps.mesh import box_asset, map_asset

    return map_asset(of) if kind == "map" else box_asset(of)


def _file_name(kind: Kind, of: Any) -> str:
    """The same for the same content."""
    digest = hashlib.sha256()
    _feed(digest.update, of)
    return f"{kind}-{digest.hexdigest()[:24]}.glb"


def _feed(update: Callable[[bytes], None], value: Any) -> None:
    """Every figure of the value, however deep, told apart by its type and its place."""
    update(f"{type(value).__name__}:".encode())
    if isinstance(value, BaseGeometry):
        update(value.wkb)
    elif isinstance(value, np.ndarray):
        update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, BaseModel):
        update(value.model_dump_json().encode())
    elif is_dataclass(value):
        _feed(update, {field.name: getattr(value, field.name) for field in fields(value)})
    elif isinstance(value, dict):
        _feed(update, list(value.items()))
    elif isinstance(value, tuple | list):
        update(f"{len(value)},".encode())
        for part in value:
            _feed(update, part)
    else:
        text = repr(value).encode()
        update(f"{len(text)},".encode() + text)
