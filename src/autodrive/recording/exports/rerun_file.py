"""A file of Rerun (.rrd) with a view: vehicles, objects, scans and images in space, and curves of the signals.

Rerun sends usage statistics unless `rerun analytics disable` was called once.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from autodrive.base.texts import encodable
from autodrive.protocol.channels import CHANNELS
from autodrive.protocol.messages import LidarScan
from autodrive.recording import Recording
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle

RATE = 30.0
"""Default rate of poses and curves [Hz]."""
TIMELINE = "time"


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write the file."""
    names = options.vehicles(recording)
    vehicles: dict[str, VehicleSpec] = {}
    for name in names:
        with recording.scenario_spec(recording.scenario_of(name)) as spec:
            vehicles[name] = load_vehicle(spec.vehicles[name].type)
    stream = rr.RecordingStream("autodrive", recording_id=encodable(recording.path.stem))
    with _written(path) as target, contextlib.ExitStack() as stack:
        stack.callback(stream.disconnect)  # writes what is left, and the index of the file
        stream.save(str(target), default_blueprint=_view(recording, names))
        _log(stream, recording, vehicles, options)


def _log(
    stream: rr.RecordingStream, recording: Recording, vehicles: dict[str, VehicleSpec], options: ExportOptions
) -> None:
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_meshes(stream, recording, vehicles)
    scans: dict[str, float] = {}
    images: dict[tuple[str, str], float] = {}
    for time, frame in options.moments(recording, options.rate or RATE):
        stream.set_time(TIMELINE, duration=time)
        for name, body in frame.objects.items():
            stream.log(f"world/objects/{name}", _transform(body.pose))
        for name in (name for name in vehicles if name in frame.vehicles):
            vehicle = frame.vehicles[name]
            stream.log(f"world/{name}", _transform(vehicle.pose))
            if vehicle.lidar is not None and scans.get(name) != vehicle.lidar.time:
                scans[name] = vehicle.lidar.time
                stream.log(f"world/{name}/lidar", rr.Points3D(_points(vehicle.lidar), radii=0.005))
            assert isinstance(vehicle.cameras, LazyImages)
            for camera, taken in vehicle.cameras.times.items():
                if images.get((name, camera)) != taken and (picture := vehicle.cameras.picture(camera)) is not None:
                    images[name, camera] = taken
                    stream.log(
                        f"images/{name}/{camera}", rr.EncodedImage(contents=picture.jpeg, media_type="image/jpeg")
                    )
        for event in frame.events:
            stream.log("events", rr.TextLog(repr(event)))
    _log_signals(stream, recording, vehicles, options)


@contextlib.contextmanager
def _written(path: Path) -> Iterator[Path]:
    """A path for Rerun to write to, whose content arrives in a file. Raises `OSError` if that cannot be written.

    Rerun writes in the background: of a full disk it only prints a message, and then it may wait forever. So it writes
    to a pipe, which never fails, and we write the file.
    """
    if not hasattr(os, "mkfifo"):  # Windows
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="autodrive-") as folder, path.open("wb") as file:
        pipe = Path(folder) / "pipe.rrd"
        os.mkfifo(pipe)
        copy = _Copy(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK), file)  # not blocking: nobody writes yet
        end = os.open(pipe, os.O_WRONLY)  # so that the pipe does not end before Rerun opens it
        copy.start()
        try:
            yield pipe
        finally:
            os.close(end)
            copy.join()
        if copy.error is not None:
            raise copy.error


class _Copy(threading.Thread):
    """Copies a pipe to a file; after an error it still reads, so that who writes to the pipe does not wait."""

    def __init__(self, pipe: int, file: BinaryIO) -> None:
        super().__init__(name="autodrive-rerun", daemon=True)
        self._pipe, self._file = pipe, file
        self.error: OSError | None = None

    def run(self) -> None:
        """Copy until the end of the pipe."""
        os.set_blocking(self._pipe, True)
        with open(self._pipe, "rb", buffering=0) as pipe:
            while data := pipe.read(2**20):
                try:
                    if self.error is None:
                        self._file.write(data)
                        self._file.flush()
                except OSError as error:
                    self.error = error


def _view(recording: Recording, names: tuple[str, ...]) -> rrb.Blueprint:
    images = [
        rrb.Spatial2DView(origin=f"images/{name}/{camera}", name=f"{name} {camera}")
        for name in names
        for camera in recording.cameras(name)
    ]
    curves = [
        rrb.TimeSeriesView(origin=f"signals/{names[0]}/{signal}", name=signal)
        for signal in ("velocity", "steering", "throttle", "imu/angular_velocity")
    ]
    space = rrb.Spatial3DView(origin="world", name="map")
    top = rrb.Horizontal(space, rrb.Vertical(*images)) if images else space
    return rrb.Blueprint(rrb.Vertical(top, rrb.Grid(*curves), row_shares=[2, 1]))


def _log_meshes(stream: rr.RecordingStream, recording: Recording, vehicles: dict[str, VehicleSpec]) -> None:
    """The .glb files of each scenario of the recording, which Rerun draws as they are."""
    scenarios = recording.scenarios
    for number, (time, scenario) in enumerate(scenarios):
        stream.set_time(TIMELINE, duration=time)
        if number:
            stream.log("world", rr.Clear(recursive=True))
        for part, name in scenario.attachments.items():
            kind, _, owner = part.partition("/")
            entity = {
                "map": "world/map",
                "vehicle": f"world/{owner}/mesh",
                "object": f"world/objects/{owner}/mesh",
            }.get(kind)
            if entity is not None and name in recording.attachments and (kind != "vehicle" or owner in vehicles):
                mesh = rr.Asset3D(contents=recording.attachment(name), media_type="model/gltf-binary")
                stream.log(entity, mesh, static=len(scenarios) == 1)
    for name, spec in vehicles.items():
        if (lidar := spec.sensors.lidar) is not None:
            stream.log(f"world/{name}/lidar", _transform(lidar.mount), static=True)


def _transform(pose: object) -> rr.Transform3D:
    """The transform of a pose or a mount."""
    w, x, y, z = map(float, pose.orientation)  # type: ignore[attr-defined]  # pyright: ignore
    position = [float(value) for value in pose.position]  # type: ignore[attr-defined]  # pyright: ignore
    return rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=[x, y, z, w]))


def _points(scan: LidarScan) -> np.ndarray:
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    is_hit = np.isfinite(scan.ranges)
    ranges, angles = scan.ranges[is_hit], angles[is_hit]
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(ranges))], axis=1)


def _log_signals(
    stream: rr.RecordingStream, recording: Recording, names: Iterable[str], options: ExportOptions
) -> None:
    """All signals that have plots, at the rate of the recording, in one call for each."""
    for vehicle in names:
        for signal in (signal for channel in CHANNELS for signal in channel.signals if not signal.size):
            name = f"{vehicle}/{signal.name.replace('.', '/')}"
            if signal.name.startswith("lidar.") or not signal.plots:
                continue
            chosen = options.includes(times := recording.signals.times(name))
            times, values = times[chosen], recording[name].astype(np.float64)[chosen]
            rows = values.reshape(len(times), -1)
            if np.isnan(rows).all():
                continue
            entity = f"signals/{name}"
            stream.log(entity, rr.SeriesLines(names=list(signal.elements) or [signal.name]), static=True)
            stream.send_columns(
                entity,
                indexes=[rr.TimeColumn(TIMELINE, duration=times)],
                columns=rr.Scalars.columns(scalars=rows.ravel()).partition([rows.shape[1]] * len(times)),
            )
