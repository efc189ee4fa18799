"""Points, lines and texts that are drawn into an image of a scene, each hidden by what is in front of it or not."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import resvg_py
from numpy.typing import NDArray

from autodrive.base.png import decode_png
from autodrive.graphics.render.gl import moderngl, source, write
from autodrive.graphics.render.lighting import perspective
from autodrive.graphics.render.scene import rigid
from autodrive.graphics.render.shadows import columns

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.physics.sensors.camera.view import View

STROKE = np.dtype([("begin", "f4", 3), ("end", "f4", 3), ("tint", "f4", 4), ("shape", "f4", 4)])
"""A stroke, see shaders/strokes.vert. The fourth number of the shape of a character is its code point."""
POINT, LINE, CHARACTER = 0, 1, 2
COLUMNS, ROWS, WIDTH, HEIGHT = 32, 16, 32, 64
"""Columns and rows of the image with the characters, and size of a character [pixels]."""
OUTLINE = 8
"""Width of the outline of each character, against a bright ground [pixels]."""
LEAST = 12.0
"""Texts that are drawn over everything have at least this height [pixels]."""
NO_CHARACTER = "□"
"""Character that is shown in place of those for which the image has no room."""


class Strokes(NamedTuple):
    """What is drawn, each dtype `STROKE`, shape (n,)."""

    hidden: NDArray[np.void]
    """What is behind other things is not seen."""
    shown: NDArray[np.void]
    """Drawn over everything; its texts do not cover each other."""


def dots(points: Floats, tint: Sequence[float], size: float) -> NDArray[np.void]:
    """Points of that diameter [m]; shape (n, 3)."""
    return _strokes(points, points, tint, POINT, size)


def lines(begin: Floats, end: Floats, tint: Sequence[float], size: float) -> NDArray[np.void]:
    """Lines of that width [m]; shape (n, 3) each."""
    return _strokes(begin, end, tint, LINE, size)


def letters(text: str, at: Floats, tint: Sequence[float], size: float) -> NDArray[np.void]:
    """A text of that height [m] with its middle at a place."""
    out = _strokes(np.tile(at, (len(text), 1)), np.zeros((len(text), 3)), tint, CHARACTER, size)
    out["shape"][:, 2] = np.arange(len(text)) - 0.5 * (len(text) - 1)
    out["shape"][:, 3] = [ord(letter) for letter in text]
    return out


def spread(strokes: NDArray[np.void], seen_from_map: NDArray[np.floating], pixel: float) -> NDArray[np.void]:
    """Strokes of which each text is moved up in the image until it covers none below it.

    `seen_from_map`: to the axes of the camera, y up and z backward; `pixel`: size of a pixel at a distance of 1 m [m].
    `web/src/scene/strokes.ts` has the same rule.
    """
    moved, i = strokes.copy(), 0
    of_letters = np.flatnonzero(strokes["shape"][:, 0] == CHARACTER)
    texts: list[tuple[Floats, slice]] = []
    placed: list[Floats] = []
    while i < len(of_letters):
        first = int(of_letters[i])
        n = round(1.0 - 2.0 * float(strokes["shape"][first, 2]))  # the first of n letters is at -(n - 1) / 2
        x, y, z = seen_from_map[:3, :3] @ strokes["begin"][first] + seen_from_map[:3, 3]
        height = max(float(strokes["shape"][first, 1]), LEAST * pixel * -z)
        if z < 0.0:
            texts.append((np.array((x, y, 0.25 * n * height, 0.5 * height)) / -z, slice(first, first + n)))
        i += n
    for box, own in sorted(texts, key=lambda text: float(text[0][1])):
        low = box[1]
        while hit := [other for other in placed if np.all(np.abs(other - box)[:2] < (other + box)[2:] - 1e-9)]:
            box[1] = hit[0][1] + hit[0][3] + box[3]
        moved["end"][own, 1] = 0.5 * (box[1] - low) / box[3]
        placed.append(box)
    return moved


def _strokes(begin: Floats, end: Floats, tint: Sequence[float], kind: int, size: float) -> NDArray[np.void]:
    out = np.zeros(len(begin), STROKE)
    out["begin"], out["end"], out["tint"] = begin, end, tint
    out["shape"][:, :2] = kind, size
    return out


class StrokePass:
    """Draws `Strokes` into the present target."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(source("strokes.vert", PLAIN=1), source("strokes.frag"))
        corners = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]], np.float32)
        self._corners = context.buffer(corners.tobytes())
        self._numbers: dict[str, int] = {}
        self._image = context.texture((COLUMNS * WIDTH, ROWS * HEIGHT), 4)
        self._add({NO_CHARACTER, *map(chr, range(ord("!"), ord("~") + 1)), "°", "µ"})  # noqa: RUF001  the sign of a unit

    def draw(self, strokes: Strokes, view: View) -> None:
        """Draw them as `view` sees them."""
        k = view.intrinsics
        eye = rigid(view.position, view.orientation) @ np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y up, z backward
        seen = columns(np.asarray(np.linalg.inv(eye), np.float64))
        shift = {"shift_x": 2.0 * k.cx / k.width - 1.0, "shift_y": 2.0 * k.cy / k.height - 1.0}
        clip = perspective(2.0 * k.fx / k.width, 2.0 * k.fy / k.height, view.near, view.far, **shift)
        write(self._program, "modelViewMatrix", seen)
        write(self._program, "viewMatrix", seen)
        write(self._program, "projectionMatrix", columns(clip @ np.diag([1.0, -1.0, -1.0, 1.0])))
        write(self._program, "image", np.array([k.width, k.height], np.float32).tobytes())
        context = self._context
        context.disable(moderngl.CULL_FACE)
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        context.fbo.depth_mask = False
        self._draw(strokes.hidden, 0.0)
        context.disable(moderngl.DEPTH_TEST)
        self._draw(spread(strokes.shown, np.linalg.inv(eye), 1.0 / k.fy), LEAST)
        context.fbo.depth_mask = True
        context.disable(moderngl.BLEND)
        context.enable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)

    def _draw(self, strokes: NDArray[np.void], least: float) -> None:
        if len(strokes) == 0:
            return
        numbered = strokes.copy()
        is_letter = numbered["shape"][:, 0] == CHARACTER
        codes, places = np.unique(numbered["shape"][is_letter, 3], return_inverse=True)
        used = [chr(int(code)) for code in codes]
        self._add(set(used) - self._numbers.keys())
        numbers = np.array([self._numbers.get(character, 0) for character in used], np.float32)
        numbered["shape"][is_letter, 3] = numbers[places]
        write(self._program, "least", np.float32(least).tobytes())
        self._image.use()
        buffer = self._context.buffer(numbered.tobytes())
        content = (self._corners, "3f", "position"), (buffer, "3f 3f 4f 4f/i", "begin", "end", "tint", "shape")
        array = self._context.vertex_array(self._program, list(content))
        array.render(moderngl.TRIANGLE_STRIP, instances=len(numbered))
        array.release()
        buffer.release()

    def _add(self, letters: set[str]) -> None:
        """Draw new characters into the image, while it has room."""
        new = sorted(letters - {" "})[: COLUMNS * ROWS - 1 - len(self._numbers)]
        if not new:
            return
        if not self._numbers:
            new.remove(NO_CHARACTER)
            self._numbers = {NO_CHARACTER: 0, " ": 1}
        for letter in new:
            self._numbers[letter] = len(self._numbers)
        font = f'font-size="{0.8 * HEIGHT}" font-family="DejaVu Sans Mono, monospace" font-weight="600"'
        outline = f'stroke="#000" stroke-width="{OUTLINE}" stroke-linejoin="round" paint-order="stroke"'
        style = f'{font} text-anchor="middle" dominant-baseline="central" fill="#fff" {outline}'
        texts = "".join(
            f'<text x="{WIDTH * (number % COLUMNS + 0.5)}" y="{HEIGHT * (number // COLUMNS + 0.5)}">'
            f"{escape(letter)}</text>"
            for letter, number in self._numbers.items()
            if letter.isprintable()
        )
        size = f'width="{COLUMNS * WIDTH}" height="{ROWS * HEIGHT}"'
        svg = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><g {style}>{texts}</g></svg>'
        pixels = decode_png(bytes(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=False)))
        self._image.write(np.ascontiguousarray(pixels).tobytes())
        self._image.build_mipmaps()  # small letters show their mean
