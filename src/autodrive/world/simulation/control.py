"""What software needs of a Simulation: its Frames and the control of its vehicles; and who receives Frames."""

from __future__ import annotations

import logging
import threading
from typing import Protocol

from autodrive.protocol.messages import Command, Frame, Operation

log = logging.getLogger(__name__)


class Sink(Protocol):
    """Receives every Frame, for example a recorder or a bridge."""

    def publish(self, frame: Frame) -> None:
        """Receive a Frame, in the thread of the simulation: return quickly, and process the Frame in another thread."""


class Control(Protocol):
    """A Simulation, or the part of it that one script may use. All members are thread-safe."""

    @property
    def frame(self) -> Frame:
        """The latest Frame."""
        ...

    def add_sink(self, sink: Sink) -> None:
        """Pass every Frame to `sink` from now on."""

    def remove_sink(self, sink: Sink) -> None:
        """Pass no more Frames to `sink`; does nothing if it was not added."""

    def submit(self, vehicle: str, command: Command) -> None:
        """Set the command for the next tick; the latest one counts. Raises `CommandError`."""

    def renew(self, vehicle: str, command: Command) -> None:
        """Drive one more tick with the command that was submitted last, so that it does not time out.

        Does nothing if it is not the last one any more, after a reset, or after a change of the driving mode.
        """

    def request(self, request: Operation) -> object:
        """Execute an operation before the next tick. Raises `CommandError`."""
        ...


class Publisher:
    """Passes Frames to Sinks. Its methods may be called from any thread."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self._sinks: tuple[Sink, ...] = ()
        self._sinks_lock = threading.Lock()

    @property
    def frame(self) -> Frame:
        """The latest Frame."""
        return self._frame

    def add_sink(self, sink: Sink) -> None:
        """Pass every Frame to `sink` from now on. A sink that raises is logged and removed."""
        with self._sinks_lock:
            self._sinks = (*self._sinks, sink)

    def remove_sink(self, sink: Sink) -> None:
        """Pass no more Frames to `sink`; does nothing if it was not added."""
        with self._sinks_lock:
            self._sinks = tuple(other for other in self._sinks if other is not sink)

    def _publish(self, frame: Frame) -> None:
        self._frame = frame
        for sink in self._sinks:
            try:
                sink.publish(frame)
            except Exception:
                log.exception("%s raised an exception and gets no more Frames", type(sink).__name__)
                self.remove_sink(sink)
