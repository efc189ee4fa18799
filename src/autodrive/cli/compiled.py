"""The command `compile`, and `python -m autodrive.cli.compiled`, which compiles for the processors of `jit.BASELINE`.

`scripts/release` puts the files of the latter into a wheel. They are used with the versions of this environment only.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import typer

LOADED = "--loaded"
"""Option of the processes that `main` starts."""


def compile_() -> None:
    """Compile what runs, races and batches need, before the first start: for containers and array jobs."""
    from autodrive.base import jit
    from autodrive.run.compile_later import use

    names: list[str] = []

    def compiled(name: str) -> None:
        names.append(name)
        typer.echo(f"{len(names):4d}  {name}", err=True)

    with jit.compiling(compiled):
        use()
    typer.echo(f"compiled {len(names)} functions into {jit.CACHE}" if names else f"all code is in {jit.CACHE}")


def main() -> None:
    """Write the files into the folder that the first argument names."""
    from autodrive.base import jit

    if sys.argv[1:] == [LOADED]:
        print_loaded()
        return
    folder = Path(sys.argv[1])
    if not jit.runs_baseline():
        sys.exit(f"this processor cannot run code for {jit.BASELINE[0]}")
    files = loaded()
    folder.mkdir(parents=True)
    for file in files:
        shutil.copy(file, folder)
    (folder / jit.VERSIONS).write_text(jit.versions(), encoding="utf-8")
    print(f"{len(files)} compiled functions, {sum(file.stat().st_size for file in files) / 1e6:.1f} MB")


def loaded() -> list[Path]:
    """The files of all that Python calls: a first process compiles, what it calls as well, and a second one loads."""
    from autodrive.base import jit

    name, features = jit.BASELINE
    environment = {**os.environ, "NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features}
    command = [sys.executable, "-P", "-m", __spec__.name, LOADED]  # -P: not a numpy.py of the working folder
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return [Path(line) for line in done.stdout.splitlines()]


def print_loaded() -> None:
    """Call everything, and print the files that the cache had."""
    from autodrive.base import jit
    from autodrive.run.compile_later import use

    used: list[Path] = []
    read = jit.read_cached

    def noted(path: Path) -> bytes:
        data = read(path)
        used.append(path)
        return data

    jit.read_cached = noted
    use()
    print(*used, sep="\n")


if __name__ == "__main__":
    main()
