"""What a server serves, and to whom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Protocol

from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import LoadScenario, UseMap
from autodrive.protocol.replay import Curve, FilmRecording, PlotRecording, RecordingStatus

if TYPE_CHECKING:
    from pathlib import Path

    from autodrive.connect.bridge.devkit import DevkitBridge
    from autodrive.graphics.cameras.jpeg import JpegEncoder
    from autodrive.graphics.cameras.scene_views import SceneViews
    from autodrive.protocol.native import Drive, Episode, ServerOperation
    from autodrive.protocol.own_files import OpenFile, OwnFile
    from autodrive.world import World
    from autodrive.world.simulation.paced import Paced
    from autodrive.world.views.scene_files import SceneFiles


NO_FOLDER = "this simulator has no folder for files of the user; start it with: autodrive run --folder FOLDER"


class Replayed(Protocol):
    """The recording that is shown instead of a simulation."""

    @property
    def position(self) -> float:
        """Time of the recording that is shown [s]."""
        ...

    def curves(self, request: PlotRecording) -> tuple[dict[str, Curve], str]:
        """Curves of the recording, by plot, and what is still missing in them, as a sentence; empty: nothing.

        Called in another thread. Raises `AutodriveError`.
        """
        ...


class RecordingControl:
    """Makes recordings of the simulation; this one refuses. The methods are called in other threads, one at a time."""

    @property
    def status(self) -> RecordingStatus:
        """The state now."""
        return RecordingStatus()

    def start(self, keep: float | None) -> None:
        """Record from now on; `keep`: only the last seconds. Raises `AutodriveError`."""
        raise AutodriveError("this simulator was started without recordings")

    def stop(self) -> str:
        """End the recording; the path of its file, empty if nothing was saved. Raises `AutodriveError`."""
        raise AutodriveError("nothing is recorded")

    def save(self) -> str:
        """Write the last seconds that were kept; the path of the file. Raises `AutodriveError`."""
        raise AutodriveError("nothing is recorded")

    def film(self, request: FilmRecording) -> str:
        """Begin to film the latest recording; the name of the film. Raises `AutodriveError`."""
        raise AutodriveError("nothing was recorded")

    def replay(self, name: str = "") -> str:
        """Serve the latest recording; the port of its page. Raises `AutodriveError`."""
        raise AutodriveError("nothing was recorded")

    def path(self, name: str) -> Path | None:
        """The complete recording or film of that name, for a download; None: there is none."""
        return None


class OwnFiles:
    """The files of the user that clients open and save; this one has none. The methods are called in other threads.

    All raise `AutodriveError`.
    """

    folder: str = ""
    """Name of the folder; empty: there is none."""

    def listed(self) -> dict[str, OwnFile]:
        """The files of the folder, by name."""
        raise AutodriveError(NO_FOLDER)

    def opened(self, operation: OpenFile, world: World) -> LoadScenario | UseMap:
        """The operation that opens a file or text beside the present World."""
        if not operation.text:
            raise AutodriveError(NO_FOLDER)
        return UseMap(text=operation.text)

    def save(self, name: str, text: str, *, replaces: bool) -> str:
        """Write NAME.yaml, and return its name; a file that is there stays unless `replaces`."""
        raise AutodriveError(NO_FOLDER)


def scene_renderer_factory(quality: str = "auto") -> Callable[[World], SceneViews]:
    """A factory of renderers with that quality; the renderer is imported when the first one starts."""

    def start(world: World) -> SceneViews:
        from autodrive.graphics.cameras.scene_views import SceneViews  # noqa: PLC0415
        from autodrive.world.views.cameras import camera_rig, scene_rig  # noqa: PLC0415

        return SceneViews(scene_rig(world, quality, paints_all=True), slots=camera_rig(world.compiled).slots)

    return start


def _no_driver(vehicle: str, is_on: bool) -> None:
    raise AutodriveError("this simulator has no driver of its own")


@dataclass(frozen=True)
class Served:
    """A simulation with all that its clients see and may do."""

    simulation: Paced
    """A Simulation, or the Player of a recording."""
    scene_files: Callable[[World], SceneFiles]
    """The files that clients need to draw a World; called in another thread, at the start and for each World that a
    `LoadScenario` loads."""
    _: KW_ONLY
    bridge: DevkitBridge | None = None
    """Connected and disconnected by requests; it need not be started. None: such requests are refused."""
    scenarios: Mapping[str, str] = field(default_factory=dict)
    """Name -> title of the scenarios that clients may load with the Simulation's `load`."""
    let_drive: Callable[[str, bool], None] = _no_driver
    """Lets the included driver drive a vehicle, or ends that; called in another thread. Raises `AutodriveError`."""
    has_start_screen: Callable[[], bool] = lambda: False
    """Whether nobody has chosen a scenario yet, so that a page offers them."""
    jpeg_encoder: JpegEncoder | None = None
    """Encodes the images of the sensor cameras; None: no pictures are sent."""
    cameras_error: Callable[[], str] = lambda: ""
    """Why the cameras failed, so that there are no pictures; empty if they did not."""
    cameras_note: Callable[[], str] = lambda: ""
    """Why there are no pictures although nothing failed; empty if there are."""
    want_pictures: Callable[[bool], None] = lambda wanted: None
    """Called in the server's thread with True when the first client wants pictures, and with False when no client
    does."""
    renderer_factory: Callable[[World], SceneViews] = field(default_factory=scene_renderer_factory)
    """Starts the process that renders the scene cameras of a World."""
    recording: RecordingControl = field(default_factory=RecordingControl)
    """Makes recordings on request."""
    own_files: OwnFiles = field(default_factory=OwnFiles)
    """Opens and saves the files of the user."""
    episode: Callable[[], Episode | None] = lambda: None
    """The present episode; None: this is no environment."""
    replay: Replayed | None = None
    """The recording that `simulation`, a Player, shows; None: it is a Simulation."""
    refusal: Callable[[ServerOperation | Drive], str] = lambda message: ""
    """Why clients may not have that operation or Drive now; empty if they may."""


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Where the page and the native protocol are served, and to whom."""

    host: str = "127.0.0.1"
    """Address on which the page is served."""
    port: int | None = None
    """Port of the page; None: that of the environment variable `AUTODRIVE_PORT`, else the default port, or the next
    free one; 0: any free port."""
    token: str | None = None
    """Access token of 16 characters or more; None: generated if other machines can connect."""
    allowed_origins: tuple[str, ...] = ()
    """Origins of other web pages that may connect, for example 'https://lab.example.org'."""
