"""Turns what happens in a World into messages of a recording."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec.structs import replace

from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.protocol.messages import CameraImage, Collision, Draw, Frame, LidarScan, OwnReading
from autodrive.recording import foxglove, records
from autodrive.recording.about import about_here
from autodrive.recording.foxglove import NANOSECONDS
from autodrive.recording.outputs import Output, Stamp
from autodrive.recording.records import EventRecord, ScenarioRecord, States
from autodrive.recording.wire import WireMessage as Layout

if TYPE_CHECKING:
    from autodrive.scenario.vehicles.spec import VehicleSpec
    from autodrive.world import World

TRANSFORM_PERIOD = NANOSECONDS // 10
"""Time between two messages of the poses for other programs [ns]."""


class Encoding:
    """Writes messages to an output; knows which scans and images it has written."""

    def __init__(self, output: Output, jpeg: JpegEncoder, quality: int, image_period: int, has_meshes: bool) -> None:
        """`image_period`: least time between two images of a camera [ns]."""
        self._output = output
        self._jpeg, self._quality = jpeg, quality
        self._image_period = image_period
        self._has_meshes = has_meshes
        self._states = States()
        self._scans: dict[str, LidarScan] = {}
        self._own: dict[tuple[str, str], OwnReading] = {}
        self._own_message = Layout(OwnReading)
        self._images: dict[tuple[str, str], _WrittenImage] = {}
        self._next_transforms = 0
        self._mounts: dict[str, Any] = {}

    def json(self, topic: str, record: Any, now: int, tick: int) -> None:
        """Write a record."""
        self._output.add(topic, Stamp(now, now, tick), records.encode_json(record))

    def drawings(self, request: Draw | None, now: int, tick: int) -> None:
        """Write what is drawn into the view, for other programs; None: all drawings are removed."""
        self._add(records.DRAWINGS, Stamp(now, now, tick), foxglove.scene_update(request, now), foxglove.SCENE_UPDATE)

    def scenario(self, world: World, record: ScenarioRecord, now: int) -> None:
        """Write the scenario of a World and its meshes."""
        self._output.begin(
            {
                "format": str(records.FORMAT),
                **about_here(),
                "scenario": record.name,
                "seed": str(record.spec.get("seed", 0)),
                "tick": str(world.tick_duration),
                "image_quality": str(self._quality),
                "recorded_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
                "time": "nanoseconds of simulated time since the start of the recording; a reset does not set them "
                "back",
            }
        )
        self._scans.clear()
        self._own.clear()
        self._mounts = {name: spec.sensors.lidar for name, spec in world.vehicle_specs.items()}
        attachments: dict[str, str] = {}
        if self._has_meshes:
            for part, name, data in _meshes(world):
                attachments[part] = name
                self._output.attach(name, "model/gltf-binary", data)
            for vehicle, files in _descriptions(world):
                attachments[f"urdf/{vehicle}"] = next(iter(files))
                for name, data in files.items():
                    self._output.attach(name, "model/stl" if name.endswith(".stl") else "application/xml", data)
        self.json(records.SCENARIO, replace(record, attachments=attachments), now, record.tick)

    def frame(self, frame: Frame, now: int, *, is_due: bool = True, has_new_images: bool = True) -> None:
        """Write a Frame, with the scans and images that are new in it; only its events unless it is due."""
        at = Stamp(now, round(frame.time * NANOSECONDS), frame.tick)
        for event in frame.events:
            self._output.add(records.EVENTS, at, records.encode_json(EventRecord(frame.tick, event)))
            if isinstance(event, Collision):
                self._output.trigger(now)
        if not is_due:
            return
        for name, vehicle in frame.vehicles.items():
            scan = vehicle.lidar
            if scan is not None and scan is not self._scans.get(name):
                self._scans[name] = scan
                message = foxglove.laser_scan(scan, now, f"{name}/lidar")
                self._add(records.scan_topic(name), at, message, foxglove.LASER_SCAN)
            for sensor, reading in vehicle.own.items():
                if reading is not self._own.get((name, sensor)):
                    self._own[name, sensor] = reading
                    self._add(records.own_topic(name, sensor), at, reading, self._own_message)
            times: dict[str, float] = {}
            for camera, image in vehicle.cameras.items():
                written = self._image(name, camera, image, at, is_wanted=has_new_images)
                if written is not None:
                    times[camera] = written
            data = self._states.encode_vehicle(vehicle, None if scan is None else scan.time, times)
            self._output.add(records.state_topic(name), at, data, self._states.vehicle)
        if now >= self._next_transforms:
            self._next_transforms = now + TRANSFORM_PERIOD
            self._transforms(frame, at)
        self._output.add(records.FRAME, at, self._states.encode_frame(frame), self._states.frame)
        self._output.end_frame(now)

    def _add(self, topic: str, at: Stamp, message: Any, layout: Layout, *, is_packed: bool = False) -> None:
        self._output.add(topic, at, layout.encode(message), layout, is_packed=is_packed)

    def _image(self, vehicle: str, camera: str, image: CameraImage, at: Stamp, *, is_wanted: bool) -> float | None:
        """Write an image if it is new and due; the time of the latest one that is written."""
        before = self._images.get((vehicle, camera))
        if before is not None and (before.image is image or at.now < before.due):
            return before.image.time
        if not is_wanted:
            return None if before is None else before.image.time
        due = at.now + self._image_period if before is None else max(before.due + self._image_period, at.now)
        self._images[vehicle, camera] = _WrittenImage(image, due)
        jpeg = self._jpeg.encode(vehicle, camera, image, size=image.rgba.shape[1::-1], quality=self._quality)
        frame_id = f"{vehicle}/{camera}_optical_frame"
        if before is None:
            calibration = foxglove.calibration(image.intrinsics, at.now, frame_id)
            self._add(records.calibration_topic(vehicle, camera), at, calibration, foxglove.CAMERA_CALIBRATION)
        message = foxglove.compressed_image(image, jpeg, at.now, frame_id)
        self._add(records.image_topic(vehicle, camera), at, message, foxglove.COMPRESSED_IMAGE, is_packed=True)
        return image.time

    def _transforms(self, frame: Frame, at: Stamp) -> None:
        """Poses for other programs: map from vehicles and objects, vehicle from LIDAR, map from cameras."""
        poses: list[tuple[str, str, Any]] = [("map", name, vehicle.pose) for name, vehicle in frame.vehicles.items()]
        poses += [("map", name, body.pose) for name, body in frame.objects.items()]
        for name, lidar in self._mounts.items():
            if lidar is not None and name in frame.vehicles:
                poses.append((name, f"{name}/lidar", lidar.mount))
        for name, vehicle in frame.vehicles.items():
            for camera, image in vehicle.cameras.items():
                poses.append(("map", f"{name}/{camera}_optical_frame", image.pose))
        message = foxglove.transforms_message(poses, at.now)
        self._add(records.TRANSFORMS, at, message, foxglove.FRAME_TRANSFORMS)


class _WrittenImage(NamedTuple):
    image: CameraImage
    due: int


def _meshes(world: World) -> list[tuple[str, str, bytes]]:
    """Part of the scene, name and content of its .glb file."""
    from autodrive.graphics.meshes import store  # noqa: PLC0415  what builds meshes waits until one is needed

    return [
        ("map", *store.file("map", world.map, is_kept=not world.specs.map.is_draft)),
        *((f"vehicle/{name}", *store.file("vehicle", spec)) for name, spec in world.vehicle_specs.items()),
        *((f"object/{name}", *store.file("box", box.size)) for name, box in world.boxes.items()),
    ]


def _descriptions(world: World) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Each vehicle and the files of its robot description, which begin with the URDF; equal vehicles have the same."""
    from autodrive.graphics.meshes import store  # noqa: PLC0415  likewise

    known: dict[str, VehicleSpec] = {}
    for vehicle, spec in world.vehicle_specs.items():
        stem = Path(world.spec.vehicles[vehicle].type).stem
        names = (stem if number == 1 else f"{stem}_{number}" for number in count(1))
        name = next(name for name in names if known.setdefault(name, spec) == spec)
        yield vehicle, store.description(spec, name)
