"""Contact forces of a recording, which does not contain them: it is simulated again, in a thread of its own."""

from __future__ import annotations

import bisect
import logging
import threading
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from autodrive import recording as recordings
from autodrive.recording.errors import RecordingError
from autodrive.recording.resimulation import forces_again

if TYPE_CHECKING:
    from autodrive.protocol.native import ContactForces

MOST = 50_000
"""Moments that are kept; of a longer recording every second, fourth, ... Frame."""
FRAMES, REST = 20, 0.002
"""Number of Frames after which the thread lets others run, and for how long [s]."""

log = logging.getLogger(__name__)


class ForcesAgain:
    """The contact forces of each Frame. The thread begins with the first call of `at`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._changed = threading.Lock()
        self._times: list[float] = []
        self._forces: list[dict[str, ContactForces]] = []
        self._is_done = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def at(self, time: float) -> dict[str, ContactForces] | None:
        """Contact forces at a time of the recording [s]; None: not known yet. Empty if it cannot be simulated again."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="autodrive-forces", daemon=True)
            self._thread.start()
        with self._changed:
            i = bisect.bisect_right(self._times, time + 1e-9)
            if i == len(self._times) and not self._is_done:
                return None
            return self._forces[i - 1] if i else {}

    @property
    def count(self) -> int:
        """Number of moments whose forces are kept."""
        return len(self._times)

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        try:
            self._simulate()
        except RecordingError as error:
            log.warning("replay: there are no contact forces from %.2f s on: %s", (*self._times, 0.0)[-1], error)
            self._add((*self._times, -1e-9)[-1] + 1e-9, {})
        finally:
            with self._changed:
                self._is_done = True

    def _simulate(self) -> None:
        step = 1
        with recordings.open(self._path) as recording, closing(forces_again(recording)) as moments:
            for number, (time, forces) in enumerate(moments):
                if self._stop.is_set():
                    return
                if number % step == 0:
                    self._add(time - recording.start, forces)
                if len(self._times) > MOST:
                    step *= 2
                    with self._changed:
                        self._times, self._forces = self._times[::2], self._forces[::2]
                if number % FRAMES == 0:
                    self._stop.wait(REST)

    def _add(self, time: float, forces: dict[str, ContactForces]) -> None:
        with self._changed:
            self._times.append(time)
            self._forces.append(forces)
