"""The formats to which a recording is exported."""

from __future__ import annotations

import contextlib
import importlib
import shutil
from dataclasses import dataclass
from pathlib import Path

from autodrive.base.cache import make_folder
from autodrive.base.installation import missing
from autodrive.base.suggest import suggest
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions


@dataclass(frozen=True)
class Format:
    """A format of an export."""

    title: str
    module: str
    """Module of this package with the function `write(recording, path, options)`."""
    suffix: str
    """Of the file; empty: it is a folder."""
    extra: str = ""
    """Extra that installs the packages that it needs."""


FORMATS = {
    "csv": Format("tables of all signals, events and commands, as CSV", "csv", ""),
    "autodrive": Format("data recorder of AutoDRIVE: CSV and camera images", "recorder_layout", ""),
    "rosbag2": Format("ROS 2 bag (MCAP)", "bag", "", "export"),
    "rosbag1": Format("ROS 1 bag", "bag", ".bag", "export"),
    "rerun": Format("Rerun, with a view", "rerun_file", ".rrd", "rerun"),
    "lerobot": Format("LeRobot dataset v3: Parquet and MP4", "lerobot", "", "export"),
    "minari": Format("Minari dataset: observations and actions", "minari_dataset", "", "export"),
}
"""By name."""


def export(
    recording: Recording, name: str, path: str | Path | None = None, options: ExportOptions | None = None
) -> Path:
    """Write a recording in a format; the file or folder that was written, by default beside the recording.

    Raises `RecordingError` if it exists, if a package is not installed, if the recording lacks what is needed, or if it
    cannot be written; nothing is left then.
    """
    if name not in FORMATS:
        raise RecordingError(f"format '{name}' is not known. {suggest(name, [*FORMATS])}")
    form = FORMATS[name]
    own = recording.path.with_name(f"{recording.path.stem}_{name}{form.suffix}")
    target = own if path is None else Path(path)
    if target.exists():
        raise RecordingError(
            f"the export would replace something that exists: remove it, or choose another path  ({target})"
        )
    make_folder(target.parent)
    try:
        write = importlib.import_module(f"autodrive.recording.exports.{form.module}").write
    except ModuleNotFoundError as error:
        if not form.extra or (error.name or "").startswith("autodrive"):
            raise
        raise RecordingError(missing(error.name or "a package", form.extra)) from None
    try:
        write(recording, target, options or ExportOptions(), name)
    except BaseException as error:
        if target.is_dir():
            shutil.rmtree(target, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):  # the file system may be read-only
                target.unlink(missing_ok=True)
        if isinstance(error, OSError):
            file = error.filename if isinstance(error.filename, str) else target
            raise RecordingError(f"cannot write: {error.strerror or error}  ({file})") from None
        raise
    return target
