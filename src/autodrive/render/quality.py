"""How much work a picture is worth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from autodrive.errors import AutodriveError
from autodrive.render.asset import Detail
from autodrive.render.gl import is_software

Antialiasing: TypeAlias = Literal["none", "fxaa", "msaa"]


@dataclass(frozen=True)
class Quality:
    """What is spent on a picture; `PROFILES` has those that are offered."""

    detail: Detail
    """Of vehicles and solid things."""
    antialiasing: Antialiasing
    still_map: int
    """Edge of the shadow map of all that stands still [pixels]; drawn anew only when something in it moved."""
    caster_map: int
    """Edge of the shadow map that holds a tile for each vehicle [pixels]."""
    casters: int
    """Vehicles whose shadows a single surface can receive."""
    beam_map: int
    """Edge of a headlight's shadow map [pixels]."""
    beam_vehicles: int
    """Vehicles whose headlights cast shadows, the nearest first."""
    lamps: int
    """Other lamps that can light a single surface."""
    taps: int
    """Of a shadow's soft edge, 1 or 9, each of four texels."""
    anisotropy: float


PROFILES = {
    "software": Quality("reduced", "none", 2048, 1024, 2, 512, 1, 4, 1, 1.0),
    "software-fxaa": Quality("reduced", "fxaa", 2048, 1024, 2, 512, 1, 4, 1, 1.0),
    "gpu": Quality("full", "msaa", 4096, 2048, 4, 1024, 4, 8, 9, 8.0),
}
"""By the words that a person may say; 'auto' takes the first or the last by what draws."""
NAMES = ("auto", *PROFILES)


def quality(name: str, renderer: str) -> Quality:
    """The profile of that name for a context that draws with `renderer`. Raises `AutodriveError`."""
    software = is_software(renderer)
    if name == "auto":
        return PROFILES["software-fxaa" if software else "gpu"]
    if name not in PROFILES:
        raise AutodriveError(f"camera quality '{name}' is not known. Known: {', '.join(NAMES)}")
    # llvmpipe takes half a minute for an anisotropic picture
    return replace(PROFILES[name], anisotropy=1.0) if software else PROFILES[name]
