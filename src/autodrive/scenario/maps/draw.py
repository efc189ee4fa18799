"""Top-view drawings of a map or a module: SVG from the same polygons that the simulation uses, and PNG."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
import resvg_py
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.icons import icon
from autodrive.scenario.maps.map import GRID, Map, load_map, load_module
from autodrive.scenario.maps.shapes import Pose, moved, rectangle
from autodrive.scenario.maps.solids import BoxPlacement, StaticShape
from autodrive.scenario.maps.spec import MapSpec, Placement

Overlay: TypeAlias = Literal["lanes", "ports", "bays"]
OVERLAYS: tuple[Overlay, ...] = ("lanes", "ports", "bays")

COLOURS = {
    "ground": "#cfcabf",
    "lawn": "#7cb05c",
    "mown": "#86ba65",
    "kerb": "#a9a79f",
    "road": "#4b4f55",
    "track": "#b9b7b0",
    "white": "#f6f5f0",
    "wall": "#9b958a",
    "duct": "#77797d",
    "block": "#c9b79c",
    "box": "#f2902b",
    "box_edge": "#b9610f",
    "post": "#55585c",
    "lane": "#35c8e8",
    "port": "#ff4f9a",
    "bay": "#ffd54a",
    "start": "#ff3b30",
}
MARGIN = 0.1
"""Around the bounds of the map [m]."""
KERB_WIDTH = 0.02
"""Width of the kerb [m], drawn outside the drivable area."""
SIGN_SIZE = 0.14
"""Size of a drawn sign [m]: twice its real size. Signs are drawn flat, as their driver sees them."""
PARAPET = 0.025
"""Width of the darker rim of walls and blocks [m]."""
SUN = np.array([0.45, -0.35])
"""Shift of a shadow per metre of height."""


def to_svg(
    map_: Map, *, pixels_per_metre: float = 200.0, overlays: Collection[Overlay] = (), starts: Iterable[Pose] = ()
) -> str:
    """The map seen from above as SVG: x to the right, y up, in its `drawn_bounds`.

    `starts`: initial poses of vehicles (x, y [m], yaw [rad]), drawn as arrows.
    """
    x0, y0, x1, y1 = drawn_bounds(map_)
    width, height = round((x1 - x0) * pixels_per_metre), round((y1 - y0) * pixels_per_metre)
    layers = [
        f'<rect x="{x0:.4f}" y="{y0:.4f}" width="{x1 - x0:.4f}" height="{y1 - y0:.4f}" fill="{COLOURS["ground"]}"/>',
        *_surfaces(map_),
        *_solids(map_),
        *_signs(map_),
        *(line for overlay in OVERLAYS if overlay in overlays for line in _OVERLAY[overlay](map_)),
        *map(_start, starts),
    ]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="{x0:.4f} {-y1:.4f} {x1 - x0:.4f} {y1 - y0:.4f}">',
            f"<title>{_escaped(map_.title)}</title>",
            _DEFINITIONS,
            '<g transform="scale(1 -1)">',
            *layers,
            "</g>",
            "</svg>",
        ]
    )


def drawn_bounds(map_: Map) -> tuple[float, float, float, float]:
    """Least x and y, greatest x and y of a drawing [m]: those of the map with a margin of 0.1 m."""
    x0, y0, x1, y1 = map(float, map_.bounds)
    return x0 - MARGIN, y0 - MARGIN, x1 + MARGIN, y1 + MARGIN


def to_png(
    map_: Map,
    path: str | Path,
    pixels_per_metre: float = 200.0,
    *,
    overlays: Collection[Overlay] = (),
    starts: Iterable[Pose] = (),
) -> None:
    """Write the drawing of the map as a PNG file."""
    svg = to_svg(map_, pixels_per_metre=pixels_per_metre, overlays=overlays, starts=starts)
    write_file(Path(path), bytes(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=True)))


def module_alone(name: str) -> Map:
    """A map that contains only that module, at the origin."""
    module = load_module(name)
    is_open = bool(module.spec.ports)
    return load_map(MapSpec(title=module.spec.title, placements=(Placement(module=name, x=0, y=0, open=is_open),)))


def _surfaces(map_: Map) -> Iterator[str]:
    if map_.track is None:
        yield _path("lawn", map_.lawn, "url(#lawn)")
        yield _path("kerb", _kerb(map_))
    yield _path("road" if map_.track is None else "track", map_.drivable)
    for kind in dict.fromkeys(marking.kind for marking in map_.markings):
        # one path for all, so that no seam is seen where lines of two modules meet; they may overlap
        lines = "".join(_painted(marking.geometry) for marking in map_.markings if marking.kind == kind)
        yield f'<path class="{kind}" d="{lines}" fill="{COLOURS["white"]}" fill-rule="nonzero"/>'


def _path(kind: str, geometry: BaseGeometry, fill: str = "") -> str:
    return f'<path class="{kind}" d="{_d(geometry)}" fill="{fill or COLOURS[kind]}" fill-rule="evenodd"/>'


def _solids(map_: Map) -> Iterator[str]:
    yield '<g fill="#1a2410" fill-opacity=".28">'
    casters = [*_fixed(map_), *map_.boxes]
    shadows = [_shadow(solid.plan, *solid.span) for solid in casters]
    yield f'<path d="{_d(shapely.union_all(shadows))}" fill-rule="evenodd"/></g>'
    for material in ("block", "wall", "duct"):
        together = [shape.plan for shape in _fixed(map_) if shape.material == material]
        outline = shapely.union_all(together, grid_size=GRID)
        yield (
            f'<path class="{material}" d="{_d(outline)}" fill="{COLOURS[material]}" fill-rule="evenodd" '
            'stroke="#00000055" stroke-width=".012"/>'
        )
        roof = outline.buffer(-PARAPET, join_style="mitre")
        yield f'<path d="{_d(roof)}" fill="#fff" fill-opacity=".22" fill-rule="evenodd"/>'
    for box in sorted(map_.boxes, key=lambda box: box.position[2]):
        yield _box(box)


def _box(box: BoxPlacement) -> str:
    """The top of a box with its two flaps."""
    length, width, _ = box.size
    return (
        f'<g class="box" transform="{_at((*box.position[:2], box.yaw))}" '
        f'stroke="{COLOURS["box_edge"]}" stroke-width=".008">'
        f'<rect x="{-length / 2:.4f}" y="{-width / 2:.4f}" width="{length:.4f}" height="{width:.4f}" '
        f'fill="{COLOURS["box"]}"/><path d="M{-length / 2:.4f} 0 H{length / 2:.4f}"/></g>'
    )


def _signs(map_: Map) -> Iterator[str]:
    for prop in map_.props:
        x, y, yaw = prop.pose
        yield (
            f'<g class="{prop.kind}" transform="{_at((x, y, yaw + math.pi / 2.0))} scale({SIGN_SIZE})">'
            f"{icon(prop.kind)}</g>"
        )


def _lanes(map_: Map) -> Iterator[str]:
    yield f'<g fill="none" stroke="{COLOURS["lane"]}" stroke-width=".014" stroke-opacity=".85">'
    for lane in map_.lane_graph.lanes:
        yield f'<path class="lane" d="{_line(lane.points)}"/>'
    yield f'</g><g fill="{COLOURS["lane"]}">'
    for lane in map_.lane_graph.lanes:
        yield f'<path d="M.035 0 L-.025 .03 L-.025 -.03 Z" transform="{_at(_middle(lane.points))}"/>'
    yield "</g>"


def _ports(map_: Map) -> Iterator[str]:
    for module in map_.modules:
        for port in module.ports:
            half = port.width / 2.0
            fill = "none" if port.is_blind else COLOURS["port"]
            yield (
                f'<g class="port" transform="{_at(port.pose)}" stroke="{COLOURS["port"]}" stroke-width=".01">'
                f'<path d="M0 {-half:.4f} V{half:.4f}"/><path d="M0 -.035 L.06 0 L0 .035 Z" fill="{fill}"/></g>'
            )


def _bays(map_: Map) -> Iterator[str]:
    for bay in map_.bays:
        yield (
            f'<g class="bay" transform="{_at(bay.pose)}" fill="{COLOURS["bay"]}" fill-opacity=".25">'
            f'<path d="{_d(rectangle((0.0, 0.0, 0.0), bay.length, bay.width))}"/>'
            f'<path d="M-.08 -.05 L.09 0 L-.08 .05 Z" fill-opacity=".9"/></g>'
        )


def _start(pose: Pose) -> str:
    return (
        f'<g class="start" transform="{_at(pose)}" fill="{COLOURS["start"]}" stroke="#fff" stroke-width=".008">'
        '<path d="M0 -.028 H.12 V-.065 L.235 0 L.12 .065 V.028 H0 Z"/><circle r=".045"/></g>'
    )


_OVERLAY = {"lanes": _lanes, "ports": _ports, "bays": _bays}

_DEFINITIONS = (
    '<defs><pattern id="lawn" width=".4" height=".4" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    f'<rect width=".4" height=".4" fill="{COLOURS["lawn"]}"/><rect width=".2" height=".4" fill="{COLOURS["mown"]}"/>'
    "</pattern></defs>"
)


def _fixed(map_: Map) -> list[StaticShape]:
    return [shape for shape in map_.statics if shape.material in {"wall", "duct", "block"}]


def _kerb(map_: Map) -> BaseGeometry:
    """The kerb around the drivable area, without the open ends of roads."""
    open_ends = [
        rectangle((port.pose[0], port.pose[1], port.pose[2]), 2.0 * KERB_WIDTH, port.width + 3.0 * KERB_WIDTH)
        for i, module in enumerate(map_.modules)
        for port in module.ports
        if not port.is_blind and (i, port.name) not in map_.joins
    ]
    return map_.drivable.buffer(KERB_WIDTH, join_style="mitre").difference(shapely.union_all(open_ends))


def _shadow(plan: shapely.Polygon, low: float, high: float) -> BaseGeometry:
    corners = shapely.get_coordinates(plan)
    return shapely.MultiPoint(np.vstack([corners + SUN * low, corners + SUN * high])).convex_hull


def _middle(points: Floats) -> Pose:
    """The pose at half the length of a line."""
    steps = np.diff(points, axis=0)
    along = np.cumsum(np.hypot(*steps.T))
    i = int(np.searchsorted(along, along[-1] / 2.0))
    heading = math.atan2(steps[i, 1], steps[i, 0])
    x, y = moved(np.array([[along[-1] / 2.0 - along[i], 0.0]]), (*points[i + 1], heading))[0]
    return x, y, heading


def _at(pose: Pose) -> str:
    return f"translate({pose[0]:.4f} {pose[1]:.4f}) rotate({pose[2] / DEGREE:.3f})"


def _line(points: Floats) -> str:
    return "M" + "L".join(f"{x:.4f} {y:.4f}" for x, y in points)


def _d(geometry: BaseGeometry) -> str:
    """SVG path data of a polygon or multipolygon."""
    rings = shapely.get_rings(shapely.get_parts(geometry))
    return "".join(f"{_line(shapely.get_coordinates(ring)[:-1])}Z" for ring in rings)


@functools.lru_cache(maxsize=20_000)
def _painted(geometry: BaseGeometry) -> str:
    """SVG path data of polygons that turn left, kept because an edit changes few of them."""
    return _d(shapely.orient_polygons(geometry))


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
