"""The formats to which a recording is exported."""

from __future__ import annotations

import importlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

from autodrive.base.cache import make_folder
from autodrive.base.errors import AutodriveError
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
    """Suffix of the file; empty: it is a folder."""
    extra: str = ""
    """Extra that installs the packages that it needs."""


FORMATS = {
    "csv": Format("tables of all signals, events and commands, as CSV", "csv", ""),
    "autodrive": Format("data recorder of AutoDRIVE: CSV and camera images", "recorder_layout", ""),
    "rosbag2": Format("ROS 2 bag (MCAP)", "bag", "", "export"),
    "rosbag1": Format("ROS 1 bag", "bag", ".bag", "export"),
    "rerun": Format("Rerun, with a view", "rerun_file", ".rrd", "rerun"),
    "lerobot": Format("LeRobot dataset v3: Parquet and MP4", "lerobot", "", "export"),
    "coco": Format("COCO dataset: images with boxes and masks", "detection", ""),
    "yolo": Format("YOLO dataset: images with boxes", "detection", ""),
    "minari": Format("Minari dataset: observations and actions", "minari_dataset", "", "export"),
}
"""Formats by name."""


def default_path(recording: Path, name: str) -> Path:
    """The file or folder of an export in that format, beside the recording."""
    return recording.with_name(f"{recording.stem}_{name}{FORMATS[name].suffix}")


def export(
    recording: Recording,
    name: str,
    path: str | Path | None = None,
    options: ExportOptions | None = None,
    *,
    replaces: bool = False,
) -> Path:
    """Write a recording in a format; the file or folder that was written, by default beside the recording.

    `replaces`: a file that exists is replaced; a folder never is. Raises `RecordingError` if it exists, if a package is
    not installed, if the recording lacks what is needed, or if it cannot be written; nothing has changed then.
    """
    if name not in FORMATS:
        raise RecordingError(f"format '{name}' is not known. {suggest(name, [*FORMATS])}")
    form = FORMATS[name]
    target = default_path(recording.path, name) if path is None else Path(path)
    if target.exists() and not (replaces and form.suffix and target.is_file()):
        raise RecordingError(
            "the export would replace a file or folder that exists: remove that file or folder, or choose another "
            f"path  ({target})"
        )
    make_folder(target.parent)
    try:
        write = importlib.import_module(f"autodrive.recording.exports.{form.module}").write
    except ModuleNotFoundError as error:
        if not form.extra or (error.name or "").startswith("autodrive"):
            raise
        raise RecordingError(missing(error.name or "a package", form.extra)) from None
    folder = str(target.parent)
    try:
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".autodrive-", ignore_cleanup_errors=True) as folder:
            part = Path(folder, target.name)  # of the same name, because files in a folder contain it
            write(recording, part, options or ExportOptions(), name)
            part.replace(target)
    except (OSError, AutodriveError) as error:
        text = str(error)
        if isinstance(error, OSError):
            text = f"cannot write: {error.strerror or error}  ({error.filename or target})"
        raise RecordingError(text.replace(folder, str(target.parent))) from None
    return target
