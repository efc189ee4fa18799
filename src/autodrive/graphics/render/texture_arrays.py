"""Textures of a scene in graphics memory: one array for each image size."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from autodrive.graphics.render.gl import moderngl

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.graphics.assets.asset import Asset
    from autodrive.graphics.render.quality import Quality


def load(
    context: moderngl.Context, assets: Iterable[Asset], quality: Quality
) -> tuple[dict[str, moderngl.TextureArray], dict[str, tuple[str, int]]]:
    """Texture arrays by name, and array and layer of each texture. Layer 0 of each array is white."""
    sizes: dict[str, list[tuple[str, NDArray[np.uint8]]]] = {}
    layers: dict[str, tuple[str, int]] = {}
    for asset in assets:
        for name, pixels in asset.textures.items():
            if name not in layers:
                height, width = pixels.shape[:2]
                members = sizes.setdefault(f"{width}x{height}", [])
                members.append((name, pixels))
                layers[name] = f"{width}x{height}", len(members)
    return {key: _array(context, [p for _, p in members], quality) for key, members in sizes.items()}, layers


def _array(context: moderngl.Context, images: list[NDArray[np.uint8]], quality: Quality) -> moderngl.TextureArray:
    height, width = images[0].shape[:2]
    pixels = np.full((1 + len(images), height, width, 4), 255, np.uint8)
    for layer, image in enumerate(images, 1):
        pixels[layer, ..., :3] = _ROOT[image]
    array = context.texture_array((width, height, len(pixels)), 4, pixels.tobytes())
    array.build_mipmaps()
    mipmap = moderngl.LINEAR_MIPMAP_LINEAR if quality.detail == "full" else moderngl.LINEAR_MIPMAP_NEAREST
    array.filter = mipmap, moderngl.LINEAR
    array.anisotropy = quality.anisotropy
    return array


def _square_roots() -> NDArray[np.uint8]:
    """Square roots of the linear values of all sRGB values; the shader squares them."""
    s = np.arange(256) / 255.0
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * np.sqrt(linear)).astype(np.uint8)


_ROOT = _square_roots()
