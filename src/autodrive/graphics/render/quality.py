"""Quality profiles: how much work is spent on an image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from autodrive.base.errors import AutodriveError
from autodrive.graphics.assets.asset import Detail
from autodrive.graphics.render.gl import is_software

Antialiasing: TypeAlias = Literal["none", "fxaa", "msaa"]


@dataclass(frozen=True)
class Quality:
    """One quality profile; see `PROFILES`."""

    detail: Detail
    """Level of detail of vehicles and solid objects."""
    antialiasing: Antialiasing
    still_map: int
    """Width of the shadow map of static meshes and objects [pixels]; redrawn only when an object has moved."""
    caster_map: int
    """Width of the shadow map that has a tile for each vehicle [pixels]."""
    casters: int
    """Number of vehicles whose shadows a single mesh can receive."""
    beam_map: int
    """Width of a headlight's shadow map [pixels]."""
    beam_vehicles: int
    """Number of vehicles whose headlights cast shadows, the nearest first."""
    lamps: int
    """Number of other lamps that can light a single mesh."""
    taps: int
    """Samples for the soft edge of a shadow, 1 or 9, each of four texels."""
    anisotropy: float
    sky_step: int = 1
    """A sky without stars is computed for each so many columns and rows."""


PROFILES = {
    "software": Quality("reduced", "none", 2048, 1024, 2, 512, 1, 4, 1, 1.0, sky_step=4),
    "software-fxaa": Quality("reduced", "fxaa", 2048, 1024, 2, 512, 1, 4, 1, 1.0, sky_step=4),
    "small": Quality("reduced", "none", 2048, 512, 2, 256, 1, 4, 1, 1.0),
    "gpu": Quality("full", "msaa", 4096, 2048, 4, 1024, 4, 8, 9, 8.0),
}
"""Profiles by name. 'auto' is 'software-fxaa' for a software renderer, else 'gpu'; 'small' is for images of about 100
pixels."""
NAMES = ("auto", *PROFILES)


def quality(name: str, renderer: str) -> Quality:
    """The profile of that name for a context that draws with `renderer`. Raises `AutodriveError`."""
    software = is_software(renderer)
    if name == "auto":
        return PROFILES["software-fxaa" if software else "gpu"]
    if name not in PROFILES:
        raise AutodriveError(f"camera quality '{name}' is not known. Known: {', '.join(NAMES)}")
    # llvmpipe takes half a minute for one image with anisotropic filtering
    return replace(PROFILES[name], anisotropy=1.0) if software else PROFILES[name]
