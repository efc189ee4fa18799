"""Options of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from autodrive.base.suggest import suggesting
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.devkit_profile import DevkitSettings
from autodrive.scenario import DEFAULT

DrivingMode: TypeAlias = Literal["manual", "autonomous"]


@suggesting
@dataclass(frozen=True)
class RunOptions:
    """Options of `autodrive.run.simulate` and of the command `autodrive run`."""

    scenario: str = DEFAULT
    """Name of a scenario, or path of its YAML file."""
    has_start_screen: bool = False
    """Whether nobody has chosen `scenario`: the page offers all scenarios until one is loaded."""
    mode: DrivingMode | None = None
    """Whether a person ("manual") or a script ("autonomous") drives. None: autonomous if `devkit` is set."""
    duration: float | None = None
    """Simulated time [s]; None: until stopped."""
    speed: float | None = 1.0
    """Simulated seconds per second of wall time; None: as fast as possible."""
    seed: int | None = None
    """Seed of all noise; None: the seed of the scenario."""
    environment: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the scenario that are replaced: `weather`, `time_of_day`."""
    devkit: tuple[str, int] | None = None
    """Host and port of the devkit script to connect to; None: no connection until a client requests one."""
    devkit_settings: DevkitSettings = DevkitSettings()  # noqa: RUF009  it is frozen
    """Devkit generation of the script, keys, formats and signs; what is left out is detected."""
    summary: Path | None = None
    """File for the summary, as JSON."""
    record: Path | None = None
    """File in which the run is recorded (MCAP)."""
    record_last: float | None = None
    """Keep only that many seconds in memory, and write them to a numbered file at each collision; None: record all."""
    cameras: bool | None = None
    """Whether camera images are rendered; None: always with `devkit`, otherwise while a client shows them."""
    is_lockstep: bool | None = None
    """Whether each image is rendered in its tick, which waits for it; otherwise images are rendered asynchronously in
    another process. None: in the tick if `speed` is None."""
    camera_quality: str = "auto"
    """One of `autodrive.graphics.render.quality.NAMES`."""
    image_size: tuple[int, int] | None = None
    """Width and height of the images that a devkit script receives [pixels]; None: those of the camera."""
    image_quality: int = 75
    """JPEG quality of the images that a devkit script receives, 1 to 100."""
    recordings: Path = Path("recordings")
    """Folder of the recordings that clients start."""
    folder: Path | None = None
    """Folder with scenarios, maps and tracks of the user, which the page opens and saves."""
    has_page: bool = True
    """Whether the page and the native protocol are served."""
    page: PageOptions = PageOptions()  # noqa: RUF009  it is frozen
    """Where the page is served, and to whom."""

    @property
    def pictures(self) -> Literal["always", "wanted", "never"]:
        """When camera images are rendered; "wanted": while a client or a devkit script receives them."""
        if self.cameras is not None:
            return "always" if self.cameras else "never"
        if self.devkit is not None or (self.has_page and self.is_lockstep):
            return "always"
        return "wanted" if self.has_page else "never"

    @property
    def draws_in_tick(self) -> bool:
        """`is_lockstep`, or its default; images that are rendered only on demand are never rendered in the tick."""
        if self.is_lockstep is not None:
            return self.is_lockstep
        return self.speed is None and self.pictures != "wanted"

    @property
    def driving_mode(self) -> DrivingMode:
        """`mode`, or its default."""
        return self.mode or ("autonomous" if self.devkit else "manual")
