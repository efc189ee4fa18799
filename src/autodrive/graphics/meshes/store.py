"""Assets of maps, vehicles and boxes, built once and cached with their .glb files."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel
from shapely.geometry.base import BaseGeometry

from autodrive.base.cache import cache_folder, read_cached, write_cached
from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.assets.glb import write_glb
from autodrive.graphics.assets.packed import pack, unpack
from autodrive.graphics.meshes.instances import map_instances
from autodrive.graphics.meshes.vehicle_paint import painted
from autodrive.graphics.render.scene import RenderScene

if TYPE_CHECKING:
    from autodrive.graphics.meshes.map import GroundPart
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.solids import BoxPlacement
    from autodrive.scenario.vehicles.spec import VehicleSpec

log = logging.getLogger(__name__)

Kind = Literal["vehicle", "map", "box"]


class Drawable(Protocol):
    """The parts of a compiled scenario that are drawn."""

    @property
    def map(self) -> Map:
        """The map."""
        ...

    @property
    def vehicles(self) -> Mapping[str, VehicleSpec]:
        """Vehicles by name, in the order of the rows of a RenderState."""
        ...

    @property
    def boxes(self) -> Sequence[BoxPlacement]:
        """Movable boxes, in the order of the rows of a RenderState."""
        ...


def scene_of(world: Drawable, *, paints_all: bool = False) -> RenderScene:
    """The scene of a world; equal vehicles and boxes share one asset.

    Several race cars have different colours, as on the page. Other cars have none, as in the original, unless it
    `paints_all`, for people.
    """
    known: dict[str, Asset] = {}

    def shared(kind: Kind, shown: Any) -> Asset:
        name = file_name(kind, shown)
        return known.get(name) or known.setdefault(name, _asset(kind, shown))

    def car(number: int, spec: VehicleSpec) -> Asset:
        asset = shared("vehicle", spec)
        return painted(asset, number) if (spec.is_race_car or paints_all) and len(world.vehicles) > 1 else asset

    return RenderScene(
        static=shared("map", world.map),
        vehicles=[car(number, spec) for number, spec in enumerate(world.vehicles.values())],
        objects=[shared("box", box.size) for box in world.boxes],
        lights=[spec.lights for spec in world.vehicles.values()],
        map_objects=[instance.name for instance in map_instances(world.map)],
    )


def vehicle(spec: VehicleSpec) -> Asset:
    """The asset of a vehicle."""
    return _asset("vehicle", spec)


def ground(map_: Map) -> Asset:
    """The asset of the static part of a map."""
    return _asset("map", map_)


def box(size: tuple[float, float, float]) -> Asset:
    """The asset of a box of that length, width and height [m]."""
    return _asset("box", size)


def file(kind: Kind, shown: Any, *, is_kept: bool = True) -> tuple[str, bytes]:
    """Name and content of the .glb file of a vehicle (its Spec), a map or a box (its size); the name is a hash.

    `is_kept`: in the cache; False for one of the many states of a map that is being built.
    """
    if not is_kept:
        return _named(kind, write_glb(_build(kind, shown)))
    name = file_name(kind, shown)
    return name, _cached(name, lambda: _build(kind, shown))[1]


def map_files(map_: Map) -> tuple[tuple[str, bytes], list[tuple[str, bytes]]]:
    """Name and content of the .glb files of a map that is being built: its solids with all textures, and its ground.

    The ground is in parts, whose textures are in the first file; parts that an edit did not change have the same file.
    """
    from autodrive.graphics.meshes.map import map_parts

    solids, parts = map_parts(map_)
    return _named("map", write_glb(solids)), [_part_file(part) for part in parts]


@lru_cache(maxsize=256)
def _part_file(part: GroundPart) -> tuple[str, bytes]:
    return _named("ground", write_glb(part.asset))


def _named(kind: str, data: bytes) -> tuple[str, bytes]:
    """Content of a file, and its name from a hash of it: faster than a hash of all that the content follows from."""
    return f"{kind}-{hashlib.sha256(data).hexdigest()[:24]}.glb", data


def description(spec: VehicleSpec, name: str) -> dict[str, bytes]:
    """The URDF of a vehicle and its meshes (STL), by path in the package `autodrive_description`; the URDF is first."""
    from autodrive.graphics.meshes.urdf import vehicle_urdf

    text, meshes = vehicle_urdf(spec, name, vehicle(spec))
    return {f"urdf/{name}.urdf": text.encode(), **meshes}


def urdf(spec: VehicleSpec, type_: str) -> str:
    """The URDF of a vehicle. `type_`: name of a vehicle, or path of its file."""
    return next(iter(description(spec, Path(type_).stem).values())).decode()


def cached(name: str, build: Callable[[], Asset]) -> Asset:
    """The asset that `build` returns, read from the cache file of that name if it exists.

    A damaged file is replaced. Without a writable cache, the asset is built each time.
    """
    return _cached(name, build)[0]


def _cached(name: str, build: Callable[[], Asset]) -> tuple[Asset, bytes]:
    """The asset, and the content of its .glb file."""
    path = folder() / f"{name}.msgpack"
    try:
        return unpack(read_cached(path))
    except OSError:
        pass
    except ValueError as error:
        log.warning("%s; the asset is built again", error)
    asset = build()
    data = pack(asset, write_glb(asset))
    with contextlib.suppress(OSError):
        write_cached(path, data)
    return unpack(data)  # identical to a later read from the cache, which has its textures as JPEG


@cache
def folder() -> Path:
    """Where the assets of this version are cached."""
    return cache_folder(
        "assets", "graphics/assets", "graphics/meshes", "scenario/vehicles", "scenario/maps", also=_libraries()
    )


def _libraries() -> str:
    return " ".join(version(name) for name in ("numpy", "shapely", "trimesh", "manifold3d", "simplejpeg"))


def _asset(kind: Kind, shown: Any) -> Asset:
    return cached(file_name(kind, shown), lambda: _build(kind, shown))


def _build(kind: Kind, shown: Any) -> Asset:
    """Imports the builders only if needed: importing them takes longer than reading from the cache."""
    if kind == "vehicle":
        from autodrive.graphics.meshes.vehicle import vehicle_asset

        return vehicle_asset(shown)
    from autodrive.graphics.meshes.map import box_asset, map_asset

    return map_asset(shown) if kind == "map" else box_asset(shown)


def file_name(kind: Kind, shown: Any) -> str:
    """File name with a hash of the content."""
    digest = hashlib.sha256()
    _add_to_digest(digest.update, shown)
    return f"{kind}-{digest.hexdigest()[:24]}.glb"


def _add_to_digest(update: Callable[[bytes], None], value: Any) -> None:
    """Hash a nested value; types and order count."""
    update(f"{type(value).__name__}:".encode())
    if isinstance(value, BaseGeometry):
        update(value.wkb)
    elif isinstance(value, np.ndarray):
        update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, BaseModel):
        update(value.model_dump_json().encode())
    elif is_dataclass(value):
        _add_to_digest(update, {field.name: getattr(value, field.name) for field in fields(value)})
    elif isinstance(value, dict):
        _add_to_digest(update, list(value.items()))
    elif isinstance(value, tuple | list):
        update(f"{len(value)},".encode())
        for part in value:
            _add_to_digest(update, part)
    else:
        text = repr(value).encode()
        update(f"{len(text)},".encode() + text)
