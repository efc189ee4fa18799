"""Sinks: the receivers of Frames, and who passes Frames to them."""

from __future__ import annotations

import logging
import threading
from typing import Protocol

from autodrive.protocol.messages import Frame

log = logging.getLogger(__name__)


class Sink(Protocol):
    """Receives every Frame, for example a recorder or a bridge."""

    def publish(self, frame: Frame) -> None:
        """Receive a Frame, in the thread of the simulation: return quickly, and process the Frame in another thread."""


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
                log.exception("%s raised and gets no more Frames", type(sink).__name__)
                self.remove_sink(sink)
