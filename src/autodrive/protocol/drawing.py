"""Drawing into the view: `world.draw.path(...)` of a World and `sim.draw.path(...)` of a Client."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.protocol.commands import MAX_DISTANCE, is_number
from autodrive.protocol.messages import MAX_DRAWINGS, MAX_POINTS, Draw, Drawing
from autodrive.protocol.native import Drawn

MAX_PRIMITIVES = 10_000
"""Most primitives of all drawings together: points, lines between two points, and characters of texts."""
LIFT = 0.01
"""Height of points that are given without one [m]."""
MAX_SIZE, MAX_LIFETIME = 100.0, 1e9


class DrawCalls:
    """Draws points, lines and texts into the view of the page; no sensor sees them, and no result depends on them.

    A drawing replaces that of the same `name`, and without points it only removes it. `points`: x, y, z [m] in the map
    frame, shape (n, 3), at most 2000, or x, y, shape (n, 2), 1 cm above the ground. `color`: '#rrggbb', or red, green,
    blue and maybe opacity, each 0 to 1. `lifetime`: simulated time after which it disappears [s]; None: it stays.
    A reset removes all. At most 10,000 primitives are drawn: points, lines between two points, characters of a text.
    Each method raises `CommandError` for values that cannot be drawn; then nothing has changed.
    """

    def __init__(self, draw: Callable[[Draw], object]) -> None:
        self._draw = draw

    def path(
        self,
        points: Any,
        *,
        name: str = "path",
        color: Any = "#ff9500",
        width: float = 0.02,
        lifetime: float | None = None,
    ) -> None:
        """Draw a line through all points; `width` [m]."""
        self._show("path", name, points, color, width, lifetime)

    def lines(
        self,
        points: Any,
        *,
        name: str = "lines",
        color: Any = "#ff9500",
        width: float = 0.02,
        lifetime: float | None = None,
    ) -> None:
        """Draw a line from the first to the second point, from the third to the fourth, and so on; `width` [m]."""
        self._show("lines", name, points, color, width, lifetime)

    def points(
        self,
        points: Any,
        *,
        name: str = "points",
        color: Any = "#ff9500",
        size: float = 0.03,
        lifetime: float | None = None,
    ) -> None:
        """Draw points; `size`: their diameter [m]."""
        self._show("points", name, points, color, size, lifetime)

    def text(
        self,
        text: str,
        position: Any,
        *,
        name: str = "text",
        color: Any = "#ffffff",
        size: float = 0.06,
        lifetime: float | None = None,
    ) -> None:
        """Draw a text of one line, at most 200 characters, with its middle at a position, shape (3,) or (2,).

        `size`: height of a line [m].
        """
        if not isinstance(text, str):
            raise CommandError(f"the text of drawing {reprlib.repr(name)} must be a text, not {reprlib.repr(text)}")
        self._show("text", name, [position], color, size, lifetime, text)

    def clear(self, name: str | None = None) -> None:
        """Remove the drawing of that name, or all."""
        self._draw(Draw({}, clears=True) if name is None else Draw({name: None}))

    def _show(
        self, kind: Any, name: str, points: Any, color: Any, size: float, lifetime: float | None, text: str = ""
    ) -> None:
        places = _places(name, points)
        drawing = None
        if places:
            known = float(size) if is_number(size) else math.nan
            time = None if lifetime is None else float(lifetime) if is_number(lifetime) else math.nan
            drawing = Drawing(kind, places, text, _color(name, color), known, time)
        request = Draw({name: drawing})
        check_drawings(request.drawings)
        self._draw(request)


def _places(name: str, points: Any) -> tuple[tuple[float, float, float], ...]:
    try:
        table = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        table = np.empty(0)
        is_table = False
    else:
        is_table = table.size == 0 or (table.ndim == 2 and table.shape[1] in (2, 3))
    if not is_table:
        raise CommandError(
            f"the points of drawing {reprlib.repr(name)} must be an array of x, y, z, shape (n, 3), or of "
            f"x, y, shape (n, 2), not {reprlib.repr(points)}"
        )
    if table.size == 0:
        return ()
    if table.shape[-1] == 2:
        table = np.column_stack((table, np.full(len(table), LIFT)))
    return tuple(map(tuple, table.tolist()))  # type: ignore[arg-type]  # pyright: ignore[reportReturnType]


def _color(name: str, color: Any) -> tuple[float, float, float, float]:
    wrong = CommandError(
        f"the color of drawing {reprlib.repr(name)} must be '#rrggbb', or 3 or 4 numbers from 0 to 1, "
        f"not {reprlib.repr(color)}"
    )
    if isinstance(color, str):
        try:
            red, green, blue = bytes.fromhex(color.removeprefix("#"))
        except ValueError:
            raise wrong from None
        return red / 255.0, green / 255.0, blue / 255.0, 1.0
    try:
        numbers = [float(part) for part in color]
    except (TypeError, ValueError):
        raise wrong from None
    if len(numbers) not in (3, 4):
        raise wrong
    red, green, blue, opacity = (*numbers, 1.0)[:4]
    return red, green, blue, opacity


def check_drawings(drawings: Mapping[str, Drawing | None]) -> None:
    """Raises `CommandError` unless all names and values can be drawn."""
    for name, drawing in drawings.items():
        title = f"drawing {reprlib.repr(name)}"
        if not isinstance(name, str) or len(name) > 100:
            raise CommandError(f"the name of a drawing must be a text of at most 100 characters, not {name!r:.120}")
        if drawing is None:
            continue
        if not (np.abs(np.array(drawing.points, np.float64)) <= MAX_DISTANCE).all():
            raise CommandError(f"the coordinates of {title} must be numbers from {-MAX_DISTANCE:g} to {MAX_DISTANCE:g}")
        least = {"points": 1, "path": 2, "lines": 2, "text": 1}[drawing.kind]
        count = len(drawing.points)
        if not least <= count <= (1 if drawing.kind == "text" else MAX_POINTS):
            most = "exactly 1 point" if drawing.kind == "text" else f"{least} to {MAX_POINTS} points"
            raise CommandError(
                f"{title}, a {drawing.kind}, needs {most}, not {count}; divide a longer drawing into several drawings"
            )
        if drawing.kind == "lines" and count % 2:
            raise CommandError(f"{title} has lines and needs two points for each line, not {count} points in all")
        if not all(is_number(part) and 0.0 <= part <= 1.0 for part in drawing.color):
            raise CommandError(f"each part of the color of {title} must be from 0 to 1, not {drawing.color}")
        if not (is_number(drawing.size) and 0.0 < drawing.size <= MAX_SIZE):
            raise CommandError(
                f"the size or width of {title} must be above 0 and at most {MAX_SIZE:g} m, not {drawing.size}"
            )
        if drawing.lifetime is not None and not (
            is_number(drawing.lifetime) and 0.0 < drawing.lifetime <= MAX_LIFETIME
        ):
            raise CommandError(f"the lifetime of {title} must be a time above 0 s, or None, not {drawing.lifetime}")
        if len(drawing.text) > 200 or not drawing.text.isprintable() or bool(drawing.text) != (drawing.kind == "text"):
            raise CommandError(
                "a drawing of kind 'text' needs a text of one line, with 1 to 200 characters; a drawing of "
                f"another kind must have no text  ({title}, a {drawing.kind})"
            )


def primitives(drawing: Drawing) -> int:
    """The number of points, lines or characters of a drawing."""
    count = len(drawing.points)
    return {"points": count, "path": count - 1, "lines": count // 2, "text": len(drawing.text)}[drawing.kind]


def drawn_after(before: Mapping[str, Drawn], request: Draw, time: float) -> dict[str, Drawn]:
    """The drawings after a request at the simulated time [s], without those that have disappeared.

    Raises `CommandError` for values that cannot be drawn, and for more than `MAX_PRIMITIVES`.
    """
    check_drawings(request.drawings)
    after = {} if request.clears else {name: drawn for name, drawn in before.items() if drawn.until > time}
    for name, drawing in request.drawings.items():
        after.pop(name, None)
        if drawing is not None:
            lifetime = math.inf if drawing.lifetime is None else drawing.lifetime
            after[name] = Drawn(name, drawing, time + lifetime)
    total = sum(primitives(drawn.drawing) for drawn in after.values() if drawn.drawing)
    if total > MAX_PRIMITIVES:
        raise CommandError(
            f"{total} points, lines and characters would be drawn; at most {MAX_PRIMITIVES} are possible: draw fewer, "
            "or remove other drawings with draw.clear()"
        )
    return after


def drawings_now(drawings: Mapping[str, Drawn], time: float) -> Draw | None:
    """The request that draws what is seen at that simulated time [s], at most 1000 drawings; None: nothing is."""
    seen = {
        name: replace(drawn.drawing, lifetime=None if math.isinf(drawn.until) else drawn.until - time)
        for name, drawn in list(drawings.items())[-MAX_DRAWINGS:]
        if drawn.drawing is not None and drawn.until > time
    }
    return Draw(dict(seen)) if seen else None
