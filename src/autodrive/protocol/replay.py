"""Messages about recordings: how a client makes one, and how it moves in one that is shown."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec

from autodrive.protocol.messages import Array, Event, Name

MAX_COLUMNS = 4096
"""Most columns of a curve."""

# -- from the client --------------------------------------------------------------------------------------------


class StartRecording(msgspec.Struct, frozen=True, tag=True):
    """Record the simulation into a file of the simulator.

    `keep` None: everything from now on, until a `StopRecording`. A number: only the last `keep` seconds are kept, until
    a `SaveRecording` writes them.
    """

    keep: Annotated[float, msgspec.Meta(ge=1.0, le=3600.0)] | None = None


class StopRecording(msgspec.Struct, frozen=True, tag=True):
    """End the recording. What was kept with `keep` and not saved is dropped."""


class SaveRecording(msgspec.Struct, frozen=True, tag=True):
    """Write the last seconds that a `StartRecording` with `keep` has kept; the recording continues."""


class FilmRecording(msgspec.Struct, frozen=True, tag=True):
    """Film the latest recording of this simulator, beside the simulation: `RecordingStatus.film` says how far it is.

    `camera`: a scene camera, or a camera of a vehicle such as 'front'. `vehicle`: the one that it follows, or on which
    it is; None: the first one. The film is then at the address recordings/NAME, relative to the page.
    """

    camera: Name = "Driver's Eye"
    vehicle: Name | None = None


class ReplayRecording(msgspec.Struct, frozen=True, tag=True):
    """Serve a recording with its page; the text of the Response is the port.

    `name`: a file of the simulator's folder of recordings, such as 'drive.mcap'; empty: the latest recording.
    """

    name: Name = ""


class PlotRecording(msgspec.Struct, frozen=True, tag=True):
    """Request curves of the recording that is shown; they are in the `curves` of the Response.

    `plots`: ids of `PLOTS` in channels.ts. `start`, `end`: times of the recording [s]; `end` None: its end. `columns`:
    the time is divided into this many equal parts, with the least and the greatest value of each.
    """

    vehicle: Name
    plots: Annotated[list[Name], msgspec.Meta(max_length=8)]
    start: float = 0.0
    end: float | None = None
    columns: Annotated[int, msgspec.Meta(ge=1, le=MAX_COLUMNS)] = 1000


RecordingOperation: TypeAlias = (
    StartRecording | StopRecording | SaveRecording | FilmRecording | ReplayRecording | PlotRecording
)

# -- from the server --------------------------------------------------------------------------------------------


class Mark(msgspec.Struct, frozen=True):
    """An event at a time of the recording [s]; the time of the event itself starts again at a Reset."""

    time: float
    event: Event


class Timeline(msgspec.Struct, frozen=True):
    """The recording that is shown: name of its file, duration [s], and its events in order."""

    name: str
    duration: float
    marks: list[Mark]


class Curve(msgspec.Struct, frozen=True):
    """Least and greatest value of a plot in each column; NaN where there is no value."""

    low: Array
    high: Array


class FilmStatus(msgspec.Struct, frozen=True):
    """State of the film that a `FilmRecording` has asked for."""

    state: Literal["off", "filming", "done"] = "off"
    name: str = ""
    """Name of its file."""
    share: float = 0.0
    """How much of it is done, 0 to 1."""
    error: str = ""
    """Why there is no film; empty if it did not fail."""


class RecordingStatus(msgspec.Struct, frozen=True):
    """State of the recording that this simulator makes."""

    state: Literal["off", "recording", "keeping"] = "off"
    file: str = ""
    """Path of the file that is written, or that was written last."""
    duration: float = 0.0
    """Simulated time that the recording contains [s]."""
    size: int = 0
    """Size of the file so far [bytes]."""
    dropped: int = 0
    """Images and scans that were not recorded, because the disk or the processor was too slow."""
    error: str = ""
    """Why the recording ended; empty if it did not fail."""
    download: str = ""
    """Name of the latest recording that is complete, at the address recordings/NAME, relative to the page."""
    film: FilmStatus = FilmStatus()
    """The film of a recording."""
