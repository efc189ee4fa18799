"""The colours that distinguish vehicles, as in web/src/vehicle_colours.ts, and the assets that have them."""

from __future__ import annotations

from dataclasses import replace

from autodrive.base.transforms import Vector
from autodrive.graphics.assets.asset import Asset, AssetNode, MeshSurface

COLOURS = ("#2f7fe0", "#f08c00", "#1fa362", "#d6336c", "#e6c700", "#7048e8", "#12a5b5", "#8a5a3c")
"""sRGB, in the order of the vehicles of a scenario. Neighbours differ for colour-blind users, too."""


def painted(asset: Asset, number: int) -> Asset:
    """The asset with its paint in the colour of the vehicle with that number."""
    colour = linear(COLOURS[number % len(COLOURS)])
    return replace(asset, nodes=tuple(_painted(node, colour) for node in asset.nodes))


def linear(colour: str) -> Vector:
    """Linear RGB of an sRGB colour such as '#2f7fe0' (IEC 61966-2-1)."""
    levels = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    red, green, blue = (x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in levels)
    return red, green, blue


def _painted(node: AssetNode, colour: Vector) -> AssetNode:
    def coloured(surface: MeshSurface) -> MeshSurface:
        material = surface.material
        return replace(surface, material=replace(material, color=colour)) if material.is_paint else surface

    return replace(node, surfaces={detail: tuple(map(coloured, parts)) for detail, parts in node.surfaces.items()})
