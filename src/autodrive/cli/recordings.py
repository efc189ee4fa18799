"""The commands for recordings: `export`, `plot`, `compare`, and `replay --resimulate`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import typer
from typer.core import TyperGroup

from autodrive.cli.options import (
    ClockOffset,
    Columns,
    Force,
    HeadingOffset,
    RecordingFile,
    RecordingOrLog,
    Run,
    Steering,
    Topics,
    TrackedPoint,
    check_outputs,
    option,
    point,
)

if TYPE_CHECKING:
    from autodrive.recording import Recording
    from autodrive.recording.drives import Drive


class ExportGroup(TyperGroup):
    """The group `export`: `autodrive export FILE --to csv` is short for `autodrive export recording FILE --to csv`."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """A word that is no command is the file of a recording."""
        if args and args[0] not in self.commands and args[0].endswith(".mcap"):
            args = ["recording", *args]
        return super().resolve_command(ctx, args)


FormatName: TypeAlias = Literal["csv", "autodrive", "rosbag2", "rosbag1", "rerun", "lerobot", "minari", "coco", "yolo"]
"""Formats of `autodrive export`."""
OWN_SENSOR = re.compile(r"(?P<vehicle>\w+)/(?P<name>\w+)=(?P<file>.+\.py):(?P<kind>\w+)")
"""The value of an option `--sensor`."""


@contextmanager
def _opened(path: Path) -> Iterator[Recording]:
    """A recording, whose problems are printed at the end."""
    from autodrive.recording import open as open_recording

    with open_recording(path) as recording:
        yield recording
        for problem in recording.problems:
            typer.echo(f"autodrive: {problem}", err=True)


def simulate_again(path: Path, sensors: Sequence[str] = ()) -> int:
    """Simulate a recording again, with sensors of the user such as 'V1/radar=my_radar.py:Radar'; the exit code."""
    from autodrive.base.python_files import load
    from autodrive.recording.resimulation import resimulate

    own: dict[str, dict[str, Any]] = {}
    for sensor in sensors:
        match = OWN_SENSOR.fullmatch(sensor)
        if match is None or not Path(match["file"]).is_file():
            raise typer.BadParameter(f"--sensor must be V1/NAME=FILE.py:CLASS with a file that exists, not '{sensor}'")
        own.setdefault(match["vehicle"], {})[match["name"]] = load(Path(match["file"]), match["kind"])
    with _opened(path) as recording:
        result = resimulate(recording, own)
    if result.made_by:
        typer.echo(f"recorded with {result.made_by}")
    typer.echo(f"{result.frames} Frames compared")
    typer.echo(str(result))
    return 0 if result.difference is None else 1


def export(
    file: RecordingFile,
    to: FormatName = option("Format.", ...),
    output: Path | None = option(
        "File or folder to write.  [default: beside the recording]", None, "--output", "-o", metavar="PATH"
    ),
    vehicle: str = option("Only this vehicle.  [default: all, or the first]", "", metavar="NAME"),
    rate: float | None = option(
        "Rows or images in a second.  [default: of the format]", metavar="HZ", min=0.01, max=1e6
    ),
    start: float | None = option("First time.  [default: the start]", metavar="S"),
    end: float | None = option("Last time.  [default: the end]", metavar="S"),
    force: Force = False,
) -> None:
    """Write a recording in a format of another program.

    csv: tables of all signals. autodrive: data recorder of AutoDRIVE. rosbag2, rosbag1: bags with the topics of the ROS
    bridge. rerun: a file of Rerun with a view. lerobot, minari: datasets for learning. coco, yolo: the images with
    boxes of their objects, to train detectors.
    """
    from autodrive.recording.exports import FORMATS, default_path
    from autodrive.recording.exports import export as write
    from autodrive.recording.exports.options import ExportOptions

    path = output or default_path(file, to)
    check_outputs(path, is_forced=force)
    with _opened(file) as recording:
        write(recording, to, path, ExportOptions(vehicle, rate, start, end), replaces=True)
    typer.echo(f"wrote {FORMATS[to].title} to {path}")


def plot(
    file: RecordingFile,
    signals: str = option("Names of signals, such as V1/velocity,V1/imu/euler.", ..., metavar="A,B"),
    output: Path | None = option("PNG or SVG file.  [default: FILE.png]", None, "--output", "-o", metavar="FILE"),
    force: Force = False,
) -> None:
    """Draw signals of a recording over time."""
    from autodrive.recording.plot import plot as draw

    path = output or file.with_suffix(".png")
    check_outputs(path, is_forced=force)
    with _opened(file) as recording:
        draw(recording, [name.strip() for name in signals.split(",") if name.strip()], path)
    typer.echo(f"wrote {path}")


def compare(
    file: RecordingOrLog,
    scenario: str | None = option(
        "Scenario that is simulated.  [default: that of the recording; the plane for a log]", metavar="NAME"
    ),
    vehicle: str = option("Vehicle of the recording.  [default: the first]", "", metavar="NAME"),
    type_: str = option("Name or file of another type of that vehicle.", "", "--type", metavar="NAME"),
    steering: Steering = "left",
    columns: Columns = "",
    topics: Topics = "",
    run: Run = "",
    tracked_point: TrackedPoint = "0,0",
    heading_offset: HeadingOffset = 0.0,
    clock_offset: ClockOffset = 0.0,
    output: Path | None = option("Draw paths and errors as PNG or SVG file.", None, "--output", "-o", metavar="FILE"),
    force: Force = False,
) -> None:
    """Simulate the commands of a drive, and print the errors of position, heading, speed and yaw rate."""
    from autodrive.recording.drives import LogOptions, read_drives
    from autodrive.recording.drives.reading import has_ros_messages, is_recorder_log
    from autodrive.recording.drives.recorder_log import read
    from autodrive.recording.exports.comparison import compare_drive, compare_log, compare_recording
    from autodrive.recording.plot import check_suffix

    if output is not None:
        check_suffix(output)
        check_outputs(output, is_forced=force)
    if file.suffix.lower() == ".mcap" and not has_ros_messages(file):
        with _opened(file) as recording:
            comparisons = {"": compare_recording(recording, vehicle, scenario, type_=type_)}
    elif vehicle:
        raise typer.BadParameter("--vehicle is for recordings (.mcap): a log has one vehicle")
    elif not (columns or run or topics) and is_recorder_log(file):
        log = read(file, is_left_positive=steering == "left")
        comparisons = {"": compare_log(log, scenario, type_=type_)}
    else:
        options = LogOptions(
            run=run,
            is_left_positive=steering == "left",
            columns=columns,
            topics=topics,
            tracked_point=point(tracked_point, "--tracked-point"),
            heading_offset=heading_offset,
            clock_offset=clock_offset,
        )
        drives = read_drives(file, options)
        if output is not None and drives[1:]:
            raise typer.BadParameter(f"--output draws one run; the table has {len(drives)}: choose with --run NAME")
        for drive in drives:
            show_problems(drive)
        comparisons = {drive.source: compare_drive(drive, scenario, type_=type_) for drive in drives}
    for source, comparison in comparisons.items():
        if comparisons.keys() - {source}:
            typer.echo(source)
        typer.echo(comparison.table())
        if output is not None:
            comparison.plot(output)
            typer.echo(f"wrote {output}")


def show_problems(drive: Drive) -> None:
    """Print what is wrong in a log."""
    for text in drive.problem_texts():
        typer.echo(f"autodrive: {text}  ({drive.source})", err=True)
