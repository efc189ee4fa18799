"""What the server needs: a source of Frames (a Simulation, or the Player of a recording), and a recorder."""

from __future__ import annotations

from concurrent.futures import Future
from typing import TYPE_CHECKING, Protocol

from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import Command, Frame, Operation
from autodrive.protocol.native import Source
from autodrive.protocol.replay import Curve, PlotRecording, RecordingStatus

if TYPE_CHECKING:
    from autodrive.world import World


class FrameSink(Protocol):
    """Receives every Frame."""

    def publish(self, frame: Frame) -> None:
        """Receive a Frame; returns quickly."""


class FrameSource(Protocol):
    """A Simulation, or what stands in its place; see `autodrive.world.simulation.Simulation`."""

    @property
    def world(self) -> World:
        """The World that the Frames belong to."""
        ...

    @property
    def frame(self) -> Frame:
        """The latest Frame."""
        ...

    @property
    def speed(self) -> float | None:
        """Target of simulated seconds per wall second."""
        ...

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per wall second, measured."""
        ...

    @property
    def late_ticks(self) -> int:
        """Ticks that ran too late."""
        ...

    @property
    def is_paused(self) -> bool:
        """Whether simulated time is stopped."""
        ...

    @property
    def is_running(self) -> bool:
        """Whether its thread is active."""
        ...

    @property
    def undo_name(self) -> str:
        """The edit that an `Undo` reverts."""
        ...

    @property
    def redo_name(self) -> str:
        """The edit that a `Redo` makes again."""
        ...

    @property
    def error(self) -> str:
        """Why the physics cannot continue."""
        ...

    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        """Set the command for the next tick. Raises `AutodriveError`."""

    def request(self, request: Operation, *, here: bool = False) -> Future[Frame]:
        """Execute a request. Raises `AutodriveError`."""
        ...

    def add_sink(self, sink: FrameSink) -> None:
        """Pass every Frame to `sink` from now on."""

    def remove_sink(self, sink: FrameSink) -> None:
        """Pass no more Frames to `sink`."""


class Replayed(Protocol):
    """The recording that is shown instead of a simulation."""

    @property
    def position(self) -> float:
        """Time of the recording that is shown [s]."""
        ...

    @property
    def refusal(self) -> str:
        """Why commands have no effect."""
        ...

    def curves(self, request: PlotRecording) -> tuple[dict[str, Curve], str]:
        """Curves of the recording, by plot, and what is still missing in them, as a sentence; empty: nothing.

        Called in another thread. Raises `AutodriveError`.
        """
        ...


class RecordingControl(Protocol):
    """Makes recordings of the simulation. The methods are called in other threads, one at a time."""

    @property
    def status(self) -> RecordingStatus:
        """The state now."""
        ...

    def start(self, keep: float | None) -> None:
        """Record from now on; `keep`: only the last seconds. Raises `AutodriveError`."""

    def stop(self) -> str:
        """End the recording; the path of its file, empty if nothing was saved. Raises `AutodriveError`."""
        ...

    def save(self) -> str:
        """Write the last seconds that were kept; the path of the file. Raises `AutodriveError`."""
        ...


class NoRecording:
    """Refuses to record."""

    status = RecordingStatus()

    def start(self, keep: float | None) -> None:
        """Raises `AutodriveError`."""
        raise AutodriveError("this simulator was started without recordings")

    def stop(self) -> str:
        """Raises `AutodriveError`."""
        raise AutodriveError("nothing is recorded")

    def save(self) -> str:
        """Raises `AutodriveError`."""
        raise AutodriveError("nothing is recorded")
