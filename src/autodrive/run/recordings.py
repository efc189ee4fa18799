"""Recordings of a run that clients start and stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.connect.server.served import PageOptions, RecordingControl
from autodrive.protocol.replay import FilmRecording, FilmStatus, RecordingStatus
from autodrive.run.film_process import FilmProcess
from autodrive.run.replay_process import ReplayProcess

if TYPE_CHECKING:
    from autodrive.graphics.cameras.jpeg import JpegEncoder
    from autodrive.recording import Recorder
    from autodrive.world.simulation import Simulation

SAVE_TIMEOUT = 10.0
"""Wall time to wait for the file of the last seconds, which contains a second after the request [s]."""


class ClientRecordings(RecordingControl):
    """Writes recordings of a Simulation to files in `folder`, named after the scenario and the time of day.

    `scenario()`: name of the current scenario. `bridge()`: state of the connection to a devkit script.
    """

    def __init__(
        self,
        simulation: Simulation,
        folder: Path,
        *,
        scenario: Callable[[], str],
        encoder: JpegEncoder | None = None,
        bridge: Callable[[], str] = lambda: "closed",
        page: PageOptions | None = None,
    ) -> None:
        """`page`: host, token and origins for the page of a replay."""
        self._simulation = simulation
        self._folder = folder
        self._scenario = scenario
        self._encoder = encoder
        self._bridge = bridge
        self._recorder: Recorder | None = None
        self._keep: float | None = None
        self._began = 0.0
        self._file = self._error = ""
        self._page = page
        self._files: dict[str, Path] = {}
        """Recordings and films that are complete, by name."""
        self._latest: Path | None = None
        self._film: FilmProcess | None = None
        self._replay: ReplayProcess | None = None

    @property
    def status(self) -> RecordingStatus:
        """The state now."""
        recorder = self._recorder
        film = FilmStatus() if self._film is None else self._film.status
        if film.state == "done" and self._film is not None:
            self._files[film.name] = self._film.output
        done = {"download": self._latest.name if self._latest else "", "film": film}
        if recorder is None:
            return RecordingStatus(file=self._file, error=self._error, **done)
        if recorder.error:
            return RecordingStatus(file=str(recorder.path), error=recorder.error, **done)
        duration = self._simulation.simulated_time - self._began
        path = recorder.files[-1] if recorder.files else None
        return RecordingStatus(
            state="recording" if self._keep is None else "keeping",
            file=str(path or ""),
            duration=duration if self._keep is None else min(duration, self._keep),
            size=_size(path) if path is not None and self._keep is None else 0,
            dropped=recorder.dropped_images + recorder.dropped_frames,
            **done,
        )

    def start(self, keep: float | None) -> None:
        """Record from now on; `keep`: only the last seconds [s]. Raises `AutodriveError`."""
        if self._recorder is not None and not self._recorder.error:
            raise AutodriveError("a recording is in progress already")
        self.stop_now()
        from autodrive.recording import Recorder

        scenario, began = self._scenario(), self._simulation.simulated_time
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"the folder of the recordings cannot be made: {error.strerror}"
            raise AutodriveError(f"{text}  ({self._folder})") from None
        self._recorder = Recorder(
            _free_path(self._folder / f"{Path(scenario).stem}-{time.strftime('%Y%m%d-%H%M%S')}.mcap"),
            self._simulation,
            name=scenario,
            last=keep,
            encoder=self._encoder,
            status=self._bridge,
        )
        self._keep, self._began, self._error = keep, began, ""

    def stop(self) -> str:
        """End the recording; the path of its last file, empty if nothing was saved. Raises `AutodriveError`."""
        if self._recorder is None:
            raise AutodriveError("nothing is recorded")
        self.stop_now()
        return self._file

    def save(self) -> str:
        """Write the last seconds that were kept; the path of the file. Raises `AutodriveError`."""
        recorder = self._recorder
        if recorder is None or self._keep is None:
            raise AutodriveError("no last seconds are kept: start a recording that keeps the last seconds")
        before = len(recorder.files)
        recorder.save()
        deadline = time.monotonic() + SAVE_TIMEOUT
        while len(recorder.files) == before and not recorder.error and time.monotonic() < deadline:
            time.sleep(0.05)
        if recorder.error:
            raise AutodriveError(recorder.error)
        if len(recorder.files) == before:
            raise AutodriveError("the last seconds are written when a second of simulated time has passed")
        self._note(recorder.files[-1])
        return self._file

    def film(self, request: FilmRecording) -> str:
        """Begin to film the latest recording; the name of the film. Raises `AutodriveError`."""
        if self._film is not None and self._film.status.state == "filming":
            raise AutodriveError("a film is being made already")
        recording = self._recorded()
        output = _free_path(recording.with_suffix(".webm"))
        self._film = FilmProcess(recording, output, request.camera, request.vehicle)
        return output.name

    def replay(self, name: str = "") -> str:
        """Serve a recording of the folder, or the latest one; the port of its page. Raises `AutodriveError`."""
        recording = self._named(name) if name else self._recorded()
        if self._replay is None or self._replay.recording != recording or not self._replay.is_running:
            if self._replay is not None:
                self._replay.close()
                self._replay = None
            self._replay = ReplayProcess(recording, self._page or PageOptions())
        return str(self._replay.port)

    def path(self, name: str) -> Path | None:
        """The complete recording or film of that name, for a download; None: there is none."""
        return self._files.get(name)

    def close(self) -> None:
        """End the recording, the film and the replay."""
        self.stop_now()
        for process in (self._film, self._replay):
            if process is not None:
                process.close()

    def _recorded(self) -> Path:
        """The latest recording that is complete. Raises `AutodriveError`."""
        if self._latest is None or not self._latest.exists():
            raise AutodriveError("nothing was recorded, or its file was removed")
        return self._latest

    def _named(self, name: str) -> Path:
        """The recording of that name in the folder. Raises `AutodriveError`."""
        path = self._folder / Path(name).name
        if path.suffix != ".mcap" or not path.is_file():
            raise AutodriveError(
                f"'{path.name}' is not in the folder of the recordings, {self._folder.absolute()}: copy it there, or "
                "run: autodrive replay FILE"
            )
        return path

    def _note(self, file: Path) -> None:
        """A recording is complete."""
        self._file, self._latest = str(file), file
        self._files[file.name] = file

    def stop_now(self) -> None:
        """End the recording if there is one."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()
            self._error = recorder.error
            if recorder.files and not recorder.error:
                self._note(recorder.files[-1])
            else:
                self._file = str(recorder.files[-1]) if recorder.files else ""


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _free_path(path: Path) -> Path:
    """The path, with a number if that file exists."""
    free, number = path, 1
    while free.exists():
        number += 1
        free = path.with_stem(f"{path.stem}-{number}")
    return free
