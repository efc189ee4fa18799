"""What `autodrive run` is asked for, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

DrivingMode: TypeAlias = Literal["manual", "autonomous"]


@dataclass(frozen=True)
class RunOptions:
    """What `autodrive run` is asked for."""

    scenario: str = "mini_map"
    """Name or file."""
    mode: DrivingMode | None = None
    """Who drives: a person or a script. None: a script if there is a devkit to connect to, else a person."""
    duration: float | None = None
    """Simulated time [s]; None: until interrupted."""
    speed: float | None = 1.0
    """Simulated seconds per wall second; None: as fast as possible."""
    seed: int | None = None
    """Of all noise; None: the scenario's."""
    devkit: tuple[str, int] | None = None
    """Host and port of the script's server."""
    devkit_profile: str | None = None
    """Era of the devkit; None: recognised."""
    summary: Path | None = None
    """File to write the summary to, as JSON."""
    cameras: bool | None = None
    """Whether the cameras' pictures are drawn; None: while there is somebody to see them."""
    is_lockstep: bool | None = None
    """Whether a picture is drawn in its tick, which waits for it; else in a process of its own, as fast as that can.
    None: in the tick if time runs as fast as possible."""
    camera_quality: str = "auto"
    """One of `autodrive.render.quality.NAMES`."""
    image_size: tuple[int, int] | None = None
    """Width and height of the pictures that a script gets [pixels]; None: the camera's."""
    image_quality: int = 75
    """JPEG quality of the pictures that a script gets, 1 to 100."""
    has_page: bool = True
    """Whether the page and the native protocol are served."""
    host: str = "127.0.0.1"
    """Address that the page is served on."""
    port: int | None = None
    """Its port; None: the usual, or the next free one."""
    token: str | None = None
    """Needed to enter; None: made up where others than this machine can reach the page."""
    allowed_origins: tuple[str, ...] = ()
    """Of pages elsewhere that may connect."""

    @property
    def pictures(self) -> Literal["always", "wanted", "never"]:
        """When the cameras' pictures are drawn: `wanted` is while somebody looks."""
        if self.cameras is not None:
            return "always" if self.cameras else "never"
        if self.devkit is not None or (self.has_page and self.is_lockstep):
            return "always"
        return "wanted" if self.has_page else "never"

    @property
    def draws_in_tick(self) -> bool:
        """What was asked for, or what follows from the rest; pictures that come and go are drawn beside the ticks."""
        if self.is_lockstep is not None:
            return self.is_lockstep
        return self.speed is None and self.pictures != "wanted"

    @property
    def driving_mode(self) -> DrivingMode:
        """The mode asked for, or what follows from the rest."""
        return self.mode or ("autonomous" if self.devkit else "manual")
