"""Options that several commands have."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from autodrive.protocol.ports import PORT, PORT_VARIABLE

RecordingFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="A recording (.mcap).")]
RecordingOrLog: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="A recording (.mcap), or a log of AutoDRIVE's data recorder (.csv).")
]
Record: TypeAlias = Annotated[
    Path | None, typer.Option(metavar="FILE.mcap", help="Record all of it in that file; see: autodrive replay --help.")
]
ResultsFolder: TypeAlias = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the results.  [default: race_DATE_TIME]"),
]
Noise: TypeAlias = Annotated[
    bool, typer.Option("--noise/--no-noise", help="LIDAR and IMU have the noise of their data sheets.")
]
Headless: TypeAlias = Annotated[
    bool, typer.Option("--headless", help="Do not serve the page; only print what goes on.")
]
Host: TypeAlias = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Address on which to serve the page; 0.0.0.0 or :: means all interfaces.")
]
Port: TypeAlias = Annotated[
    int | None,
    typer.Option(
        min=0, max=65535, help=f"Port of the page.  [default: ${PORT_VARIABLE}, else {PORT} or the next free one]"
    ),
]
Token: TypeAlias = Annotated[
    str | None,
    typer.Option(help="Access token.  [default: generated if --host lets other machines connect]"),
]
Browser: TypeAlias = Annotated[
    bool, typer.Option("--browser/--no-browser", help="Open the page in the browser if there is a display.")
]


def results_folder(chosen: Path | None) -> Path:
    """The folder of the results of a race."""
    return chosen or Path(f"race_{datetime.now():%Y-%m-%d_%H-%M-%S}")
