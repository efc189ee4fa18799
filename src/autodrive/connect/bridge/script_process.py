"""A devkit script as a process of its own."""

from __future__ import annotations

import shlex
import socket
import subprocess
import sys
from pathlib import Path
from typing import IO

from autodrive.base.child_process import Group, environment
from autodrive.base.errors import AutodriveError
from autodrive.base.python_files import replacing_modules

_running: set[ScriptProcess] = set()


class ScriptProcess:
    """Runs `command`, in which '{port}' is a free port of this machine, in `folder`; what it prints goes to `output`.

    Raises `AutodriveError` if it cannot be started.
    """

    def __init__(self, command: str, folder: Path, output: IO[bytes]) -> None:
        self._output = output
        with socket.create_server(("127.0.0.1", 0)) as listener:
            self.port: int = listener.getsockname()[1]
        words = shlex.split(command)
        self._folders = {(folder / word).parent for word in words if word.endswith(".py")}
        line = [sys.executable if word == "python" else word.replace("{port}", str(self.port)) for word in words]
        # another Python has packages of its own, which those of this one would replace
        variables = environment() if line[0] == sys.executable else None
        try:
            self._group = Group(line, cwd=folder, env=variables, stdout=output, stderr=subprocess.STDOUT)
        except OSError as error:
            raise AutodriveError(f"the script cannot be started: {error.strerror}: {line[0]}") from None
        _running.add(self)

    @property
    def end(self) -> str:
        """How it has ended, with the last line that it printed; empty while it runs."""
        if (code := self._group.exit_code) is None:
            return ""
        self._output.seek(0)
        lines = self._output.read().decode("utf-8", "replace").strip().splitlines()
        end = f"the script ended with exit code {code}" + (f": {lines[-1][:200]}" if lines else "")
        replacing = [name for folder in self._folders for name in replacing_modules(folder)] if code else []
        return end + (
            f"; files in the folder of the script replace Python modules of the same name: {', '.join(replacing)}"
            if replacing
            else ""
        )

    def close(self) -> None:
        """End the script, and all processes that it started."""
        self._group.close()
        _running.discard(self)


def close_all() -> None:
    """End all scripts, for a process that ends without closing them."""
    for script in list(_running):
        script.close()
