"""The picture of a world that is still being compiled: another process makes that world as plain Python, in seconds."""

from __future__ import annotations

import pickle
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from autodrive.base.child_process import start_module, take_stdout

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable

    from autodrive.connect.server.server import SimulationServer
    from autodrive.protocol.messages import Frame
    from autodrive.run.options import RunOptions
    from autodrive.world.views.scene_files import SceneFiles


class FirstPicture:
    """A context in which a server gets its world: after `begin` its clients see the start of the scenario."""

    def __init__(self, server: SimulationServer | None, options: RunOptions) -> None:
        self._server, self._options = server, options
        self._process: subprocess.Popen[bytes] | None = None
        self._beginning = threading.Lock()

    def __enter__(self) -> FirstPicture:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def begin(self) -> None:
        """Make the picture in the background; does nothing if that has begun, or without a server."""
        with self._beginning:  # each process that compiles reports its functions in a thread of its own
            if self._process is None and self._server is not None:
                self._process = start_module(__name__, NUMBA_DISABLE_JIT="1")
                threading.Thread(target=self._show, args=(self._process, self._server.show), daemon=True).start()

    @property
    def has_begun(self) -> bool:
        """Whether something had to be compiled."""
        return self._process is not None

    def _show(self, process: subprocess.Popen[bytes], show: Callable[[SceneFiles, Frame], None]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        # A process that fails or is ended says nothing: the page shows the steps of the start, and the error of it.
        with suppress(BrokenPipeError, EOFError, pickle.UnpicklingError):
            pickle.dump(self._options, process.stdin)
            process.stdin.flush()
            show(*pickle.load(process.stdout))


def main() -> None:
    """Read the options of the run; write the scene files and the Frame of the world at its start."""
    from autodrive.run.world_loader import WorldLoader
    from autodrive.world.factory import compile_scenario, world_of
    from autodrive.world.views.scene_files import SceneFiles

    answers = take_stdout()
    options: RunOptions = pickle.load(sys.stdin.buffer)
    world = world_of(compile_scenario(WorldLoader(options).spec(options.scenario)))
    pickle.dump((SceneFiles.of(world, options.scenario), world.frame), answers)
    answers.flush()
