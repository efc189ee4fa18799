"""The overlay of a film: speed and steering of a vehicle. It is drawn with strokes, so that no font is needed."""

from __future__ import annotations

import functools
import math

import numpy as np
import resvg_py
from numpy.typing import NDArray

from autodrive.base.png import decode_png

WIDTH, HEIGHT = 300, 92
"""Size of the overlay, in units of which an image of 720 lines has one per pixel."""

_GLYPHS = {
    "0": "M2 0h6q2 0 2 2v14q0 2-2 2h-6q-2 0-2-2v-14q0-2 2-2z",
    "1": "M3 3l3-3v18",
    "2": "M0 3q0-3 3-3h4q3 0 3 3v3q0 2-2 3l-6 4q-2 1-2 3v2h10",
    "3": "M0 0h10l-6 7h2q4 0 4 4v3q0 4-4 4h-3q-3 0-3-3",
    "4": "M8 18v-18l-8 12v1h10",
    "5": "M10 0h-9l-1 8q2-1 4-1h2q4 0 4 4v3q0 4-4 4h-3q-3 0-3-3",
    "6": "M9 0q-9 2-9 11v3q0 4 4 4h2q4 0 4-4v-2q0-4-4-4h-2q-4 0-4 4",
    "7": "M0 0h10l-6 18",
    "8": "M3 8q-2 0-2-2v-4q0-2 2-2h4q2 0 2 2v4q0 2-2 2h-4q-3 0-3 3v4q0 3 3 3h4q3 0 3-3v-4q0-3-3-3",
    "9": "M1 18q9-2 9-11v-3q0-4-4-4h-2q-4 0-4 4v2q0 4 4 4h2q4 0 4-4",
    "-": "M1 9h8",
    ".": "M0 17.5h1",
    "m": "M0 18v-11M0 10q0-3 3-3h0q2 0 2 3v8M5 10q0-3 3-3h0q2 0 2 3v8",
    "s": "M8 8q-1-1-4-1q-4 0-4 2.5q0 2.5 4 3q4 .5 4 3q0 2.500-4 2.500q-3 0-4-1",
    "/": "M0 18l6-18",
    "°": "M3 0q3 0 3 3q0 3-3 3q-3 0-3-3q0-3 3-3z",
}
"""Strokes of each character, 10 wide and 18 high."""
_ADVANCE = {".": 5.0, "/": 10.0, "°": 9.0, " ": 7.0, "s": 12.0}


_PANEL = f'''<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="#10151b" fill-opacity=".78"/>
<rect x="20" y="48" width="260" height="7" rx="3" fill="#3a4653"/>
<path d="M90 76h120M150 70v12" stroke="#3a4653" stroke-width="6" stroke-linecap="round"/>'''
_KNOB = '<circle cx="8" cy="8" r="7" fill="#7db4ff"/>'
_STROKES = '<g fill="none" stroke="#fff" stroke-width="2.4" stroke-linecap="round" stroke-linejoin="round">{}</g>'
_FORWARD, _REVERSE = (125, 180, 255), (255, 194, 77)


def with_overlay(
    image: NDArray[np.uint8], *, speed: float, speed_limit: float, steering: float, steering_limit: float
) -> NDArray[np.uint8]:
    """The image with speed [m/s] and steering angle [rad] (left positive) in its lower left corner."""
    out = image.copy()
    scale = round(image.shape[0] / 720.0, 3)
    left, top = 20 * scale, image.shape[0] - (HEIGHT + 20) * scale

    def put(sprite: NDArray[np.uint8], x: float, y: float) -> None:
        _blend(out, sprite, round(left + scale * x), round(top + scale * y))

    put(_sprite(_PANEL, WIDTH, HEIGHT, scale), 0, 0)
    for text, begin in ((f"{speed:z.2f} m/s", 20.0), (f"{math.degrees(steering):z.1f}°", 176.0)):
        x = begin
        for character in text:
            if character in _GLYPHS:
                put(_glyph(character, scale), x - 2, 14)
            x += _ADVANCE.get(character, 15.0)
    share = min(abs(speed) / speed_limit, 1.0) if speed_limit else 0.0
    x0, x1, y0, y1 = left + scale * 20, left + scale * (20 + 260 * share), top + scale * 48, top + scale * 55
    out[round(y0) : round(y1), round(x0) : round(x1)] = _REVERSE if speed < 0 else _FORWARD
    turn = min(max(steering / steering_limit, -1.0), 1.0) if steering_limit else 0.0
    put(_sprite(_KNOB, 16, 16, scale), 142 - 60 * turn, 68)  # left of the middle for a left turn
    return out


def _blend(image: NDArray[np.uint8], sprite: NDArray[np.uint8], left: int, top: int) -> None:
    """Draw RGBA over a part of the image; what is outside is left out."""
    x, y = max(left, 0), max(top, 0)
    place = image[y : top + sprite.shape[0], x : left + sprite.shape[1]]
    if place.size == 0:
        return
    part = sprite[y - top :, x - left :][: place.shape[0], : place.shape[1]].astype(np.float32)
    alpha = part[..., 3:] / 255.0
    place[:] = (alpha * part[..., :3] + (1.0 - alpha) * place).round()


@functools.lru_cache(maxsize=64)
def _glyph(character: str, scale: float) -> NDArray[np.uint8]:
    path = f'<path transform="translate(2 2)" d="{_GLYPHS[character]}"/>'
    return _sprite(_STROKES.format(path), 15, 22, scale)


@functools.lru_cache(maxsize=64)
def _sprite(body: str, width: int, height: int, scale: float) -> NDArray[np.uint8]:
    """RGBA of a drawing."""
    size = f'width="{max(round(width * scale), 1)}" height="{max(round(height * scale), 1)}"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width} {height}">{body}</svg>'
    return decode_png(bytes(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=True)))
