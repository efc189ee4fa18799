"""Options that several commands have."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, TypeAlias, TypeVar

import typer

from autodrive.base.errors import AutodriveError
from autodrive.protocol.devkit_profile import Side
from autodrive.protocol.ports import PORT, PORT_VARIABLE

Options = TypeVar("Options")

RecordingFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="A recording (.mcap).")]
RecordingOrLog: TypeAlias = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="A recording (.mcap), a log of AutoDRIVE's data recorder, a table with a header (.csv, .csv.gz), or a ROS "
        "bag.",
    ),
]
Steering: TypeAlias = Annotated[Side, typer.Option(help="Where a positive steering angle of a log points.")]
Columns: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME=COLUMN,...",
        help="Columns of a table: time, x, y, yaw, speed, yaw_rate, throttle, steering, steering_angle, safety, "
        "command_time, run. With unit, scale and constant: yaw=psi [deg], throttle=u*0.01-0.2",
    ),
]
Topics: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME=TOPIC,...",
        help="Topics of a ROS bag: pose, odometry, command, imu, or a column, such as throttle=/cmd:data*0.5.  "
        "[default: by their types]",
    ),
]
Run: TypeAlias = Annotated[str, typer.Option(metavar="NAME", help="Only this run of a table.  [default: all]")]
TrackedPoint: TypeAlias = Annotated[
    str,
    typer.Option(metavar="X,Y", help="Measured point of the car, forward and left of the centre of the rear axle [m]."),
]
HeadingOffset: TypeAlias = Annotated[
    float, typer.Option(metavar="RAD", help="Angle that is added to the yaw of a log, so that it is the heading.")
]
ClockOffset: TypeAlias = Annotated[
    float, typer.Option(metavar="S", help="Time that is added to the times of the commands of a log.")
]
Record: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="FILE.mcap", help="Record the whole run in that file; see: autodrive replay --help."),
]
ResultsFolder: TypeAlias = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the results.  [default: race_DATE_TIME]"),
]
Noise: TypeAlias = Annotated[
    bool, typer.Option("--noise/--no-noise", help="LIDAR and IMU have the noise of their data sheets.")
]
Headless: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--headless",
        help="Do not serve the page; only print the progress. Clients and the direct ROS bridge cannot connect then.",
    ),
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
Force: TypeAlias = Annotated[bool, typer.Option("--force", help="Replace files that exist, without a question.")]

MOST_NAMES = 8
"""Names of files in a message."""


def option(help: str, default: Any = None, *names: str, **settings: Any) -> Any:
    """An option of a command, with what `typer.Option` takes; `default` ...: it must be given."""
    return typer.Option(default, *names, help=help, **settings)


def argument(help: str, default: Any = None, **settings: Any) -> Any:
    """An argument of a command, with what `typer.Argument` takes; `default` ...: it must be given."""
    return typer.Argument(default, help=help, **settings)


def filled(options: type[Options], arguments: Mapping[str, Any], **converted: Any) -> Options:
    """The options of a command: its arguments, for the fields with their names, and those that it has converted."""
    names = {field.name for field in dataclasses.fields(options)}  # pyright: ignore[reportArgumentType]
    return options(**{name: value for name, value in arguments.items() if name in names} | converted)


def point(text: str, name: str) -> tuple[float, float]:
    """The two numbers of an option such as '0.15,-0.01'. Raises `BadParameter`."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{name} must be two numbers such as 0.15,-0.01, not '{text}'") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise typer.BadParameter(f"{name} must be two finite numbers, not '{text}'")
    return x, y


def check_end(option: str, file: Path | None, *ends: str) -> None:
    """Raises `BadParameter` unless the name of a file has one of these ends, such as '.png'."""
    if file is not None and file.suffix.lower() not in ends:
        raise typer.BadParameter(f"{option} must end in {' or '.join(ends)}, not '{file.suffix}'")


def check_outputs(*files: Path | None, is_forced: bool) -> None:
    """Ask whether a command may replace files that exist, before it writes them; `is_forced`: it may.

    Raises `AutodriveError` if the answer is no, or if nobody can be asked because there is no terminal.
    """
    existing = list(dict.fromkeys(file for file in files if file is not None and file.is_file()))  # not a device
    if not existing or is_forced:
        return
    names = ", ".join(map(str, existing[:MOST_NAMES]))
    if existing[MOST_NAMES:]:
        names += f", and {len(existing) - MOST_NAMES} more"
    question = "the files exist: replace them" if existing[1:] else "the file exists: replace it"
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise AutodriveError(f"{question} with --force, or choose another name  ({names})")
    if not typer.confirm(f"{question}?  ({names})", err=True):
        raise AutodriveError(f"nothing was written  ({names})")


def results_folder(chosen: Path | None) -> Path:
    """The folder of the results of a race."""
    return chosen or Path(f"race_{datetime.now():%Y-%m-%d_%H-%M-%S}")
