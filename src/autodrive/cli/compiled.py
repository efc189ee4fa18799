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

    used: list[Path] = []
    read = jit.read_cached

    def noted(path: Path) -> bytes:
        data = read(path)
        used.append(path)
        return data

    jit.read_cached = noted
    use()
    print(*used, sep="\n")


def use() -> None:
    """Call what is to be compiled."""
    import autodrive
    from autodrive.scenario.scenario import TrafficSpec
    from autodrive.scenario.v2x import V2xSpec

    noisy = autodrive.ScenarioSpec(
        map="mini_map",
        vehicles={
            "V1": autodrive.VehiclePlacement(has_realistic_sensors=True),
            "V2": autodrive.VehiclePlacement(x=1.0),
        },
        v2x=V2xSpec(jitter=0.01, position_noise=0.01),
    )
    beside = {"V1": autodrive.VehiclePlacement(y=1.15)}
    traffic = autodrive.ScenarioSpec(map="oval", vehicles=beside, traffic=TrafficSpec(cars=2))
    for scenario in (noisy, "tiny_town", traffic, "practice"):  # tiny_town: stop lines; practice: a race
        world = autodrive.make(scenario)
        for _ in range(50):  # in half a second each sensor samples
            world.step({})
    autodrive.BatchWorld("mini_map", n=2).step([[[0.0, 0.0]]] * 2)
    try:
        autodrive.make("mini_map", cameras=True).step({})
    except autodrive.GlUnavailable as error:
        print(f"without the code of the cameras: {error}", file=sys.stderr)


if __name__ == "__main__":
    main()
