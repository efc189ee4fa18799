"""Suggestions for unknown words: what is known, and what was probably meant."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

_MEANINGS = {
    "boxes": ("objects", "obstacles", "crates", "box"),
    "command_timeout": ("timeout", "time_out"),
    "has_realistic_sensors": ("noise", "noisy", "realistic", "realistic_sensors"),
    "height": ("z_size",),
    "is_autonomous": ("autonomous", "mode", "driving_mode", "manual"),
    "is_closed": ("closed", "loop"),
    "map": ("world", "track", "environment"),
    "mass": ("weight",),
    "module": ("type", "kind", "name"),
    "placements": ("modules", "tiles", "pieces", "roads"),
    "points": ("corners", "vertices", "line", "path"),
    "radius": ("r",),
    "rate": ("frequency", "hz", "fps", "rate_hz"),
    "rays": ("beams", "resolution", "samples"),
    "scene_light": ("light", "day", "night", "daylight", "lighting"),
    "seed": ("random_seed", "rng"),
    "size": ("dimensions", "scale", "extent"),
    "substep": ("physics_step", "sub_step"),
    "thickness": ("width",),
    "tick": ("dt", "step", "time_step", "timestep", "tick_duration"),
    "title": ("name", "label", "description"),
    "type": ("model", "vehicle", "kind", "car"),
    "vehicles": ("cars", "robots", "agents", "vehicle"),
    "x": ("position", "pos", "pose", "xy"),
    "yaw_deg": ("yaw", "heading", "angle", "rotation", "orientation", "theta", "direction", "yaw_rad", "phi"),
}
"""Key of a YAML file -> other words that people use for it."""


def suggest(word: str, known: list[str]) -> str:
    """Text for an unknown word: 'Known: a, b. Did you mean 'a'?'; of many known words, the first 100."""
    more = f" and {len(known) - 100} more" if len(known) > 100 else ""
    known, word = known[:100], word[:100]
    text = f"Known: {', '.join(known) or 'none'}{more}."
    same = [key for key in known if word.lower() in (key.lower(), *_MEANINGS.get(key, ()))]
    close = same or difflib.get_close_matches(word, known, n=1)
    return f"{text} Did you mean '{close[0]}'?" if close else text


def check_keywords(name: str, words: Iterable[str], known: list[str]) -> None:
    """Raises `TypeError` for a keyword argument that `name` does not have."""
    for word in words:
        if word not in known:
            raise TypeError(f"{name}() has no argument '{word}'. {suggest(word, known)}")


def with_suggestions(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """The function, whose error for an unknown keyword argument says which there are."""
    name = function.__qualname__.removesuffix(".__init__")
    known = [parameter for parameter in inspect.signature(function).parameters if parameter != "self"]

    @functools.wraps(function)
    def checked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        check_keywords(name, kwargs, known)
        return function(*args, **kwargs)

    return checked


def suggesting(kind: type[Result]) -> type[Result]:
    """A class, such as a dataclass of options, whose error for an unknown keyword argument says which there are."""
    kind.__init__ = with_suggestions(kind.__init__)
    return kind


class ByName(dict[str, Any]):
    """A dictionary whose error for an unknown key says which keys there are."""

    __slots__ = ()

    def __missing__(self, key: object) -> Any:
        raise KeyError(f"'{key}' is not known. {suggest(str(key), [*self])}")
