"""Films a recording in a process of its own, at low priority, so that the simulation goes on."""

from __future__ import annotations

import os
import pickle
import sys
import threading
from pathlib import Path

from autodrive.base.child_process import start_module, take_stdout
from autodrive.base.errors import AutodriveError
from autodrive.protocol.replay import FilmStatus

END = "the process of the film has ended"


class FilmProcess:
    """Makes a film; `status` says how far it is."""

    def __init__(self, recording: Path, output: Path, camera: str, vehicle: str | None) -> None:
        self.output = output
        self.status = FilmStatus("filming", output.name)
        """How far the film is; changes in another thread."""
        self._process = start_module(__name__, has_children=True)
        self._thread = threading.Thread(target=self._watch, args=((recording, output, camera, vehicle),), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the process; an unfinished film is dropped."""
        self._process.terminate()
        self._process.wait()
        self._thread.join()

    def _watch(self, task: tuple[Path, Path, str, str | None]) -> None:
        process, name = self._process, self.output.name
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump(task, process.stdin)
            process.stdin.flush()
            while not isinstance(answer := pickle.load(process.stdout), str):
                self.status = FilmStatus("filming", name, share=answer)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            answer = END
        self.status = FilmStatus("off", error=answer) if answer else FilmStatus("done", name, share=1.0)
        process.stdin.close()


def main() -> None:
    """Read what is to be filmed; write the share that is done, several times, and at last the error or ''."""
    if hasattr(os, "nice"):  # not on Windows, where the priority is low already
        os.nice(10)
    answers = take_stdout()
    recording, output, camera, vehicle = pickle.load(sys.stdin.buffer)

    def tell(answer: float | str) -> None:
        pickle.dump(answer, answers)
        answers.flush()

    try:
        from autodrive.recording.film import FilmOptions, film
        from autodrive.recording.replay.tape import Tape

        with Tape(recording) as tape:
            options = FilmOptions(camera=camera, vehicle=vehicle)
            film(tape, output, options, lambda done, total: tell(done / total))
    except AutodriveError as error:
        tell(str(error))
    except Exception as error:
        tell(f"the film failed: {error}")
    else:
        tell("")
