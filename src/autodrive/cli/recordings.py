"""The commands for recordings: `replay`, `export`, `plot`, `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FilePath = Annotated[Path, typer.Argument(metavar="FILE", help="A recording, as `autodrive run --record` writes it.")]


def simulate_again(path: Path) -> int:
    """Simulate a recording again; the exit code."""
    from autodrive.recording import open as open_recording
    from autodrive.recording.resimulation import resimulate

    with open_recording(path) as recording:
        result = resimulate(recording)
    if result.made_by:
        typer.echo(f"recorded with {result.made_by}")
    typer.echo(f"{result.frames} Frames compared")
    typer.echo(str(result))
    return 0 if result.difference is None else 1
