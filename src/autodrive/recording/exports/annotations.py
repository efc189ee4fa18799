"""What a recorded image shows: each object with its box, its mask, and how much of it is hidden.

The objects are drawn again from the recorded state, as numbers instead of colours; the image itself is not changed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from autodrive.base.transforms import compose, inverse, rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset, AssetNode
from autodrive.graphics.meshes.instances import Instance, instances_of
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import VEHICLE, RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import Skeleton, instance_of, rigid, signals_of
from autodrive.physics.sensors.camera.optics import ideal_pinhole
from autodrive.physics.sensors.camera.view import View
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages
from autodrive.world.factory import compile_scenario

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import Picture
    from autodrive.recording.records import ScenarioRecord
    from autodrive.scenario import ScenarioSpec

LEAST_PIXELS = 16
"""Objects of which fewer pixels are seen are left out."""
MAX_DELAY = 1000
"""Most Frames from that of an image to the first one that has it, when a process draws the images."""


class PixelBox(NamedTuple):
    """A box around pixels: left and upper edge, width and height [pixels]."""

    x: int
    y: int
    width: int
    height: int

    @staticmethod
    def around(mask: NDArray[np.bool_]) -> PixelBox:
        """The smallest box around the pixels of a mask that has any."""
        (rows,), (columns,) = np.nonzero(mask.any(1)), np.nonzero(mask.any(0))
        x, y = int(columns[0]), int(rows[0])
        return PixelBox(x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1)


class SolidBox(NamedTuple):
    """A box around an object at rest, in the optical frame of the camera (x right, y down, z forward)."""

    center: list[float]
    """[m]."""
    size: list[float]
    """Length, width and height, along x, y and z of the object [m]."""
    orientation: list[float]
    """Quaternion wxyz, optical frame from object."""


@dataclass(frozen=True)
class Annotation:
    """An object in an image."""

    number: int
    """Instance number of the object."""
    instance: Instance
    mask: NDArray[np.bool_]
    """Which pixels show it, shape (height, width)."""
    whole: NDArray[np.bool_]
    """Which pixels would show it if nothing hid it."""
    solid: SolidBox
    state: str
    """What a traffic light shows: 'off', 'red', 'yellow' or 'green'; empty for other objects."""

    @property
    def area(self) -> int:
        """Number of pixels that show it."""
        return int(np.count_nonzero(self.mask))

    @property
    def occlusion(self) -> float:
        """Share of the object within the image that other objects hide, from 0 to 1."""
        return 1.0 - self.area / int(np.count_nonzero(self.whole))


class AnnotatedImage(NamedTuple):
    """A recorded image and its objects."""

    time: float
    """Time of the recording [s]."""
    picture: Picture
    annotations: list[Annotation]


def annotated_images(recording: Recording, options: ExportOptions) -> Iterator[AnnotatedImage]:
    """The images of the chosen vehicles in order, at most `options.rate` of each camera. Raises `RecordingError`."""
    vehicles = options.vehicles(recording)
    last: dict[tuple[str, str], float] = {}
    if not any(recording.cameras(vehicle) for vehicle in vehicles):
        raise RecordingError(f"the recording has no images of {options.vehicle or 'a vehicle'}; record with --cameras")
    annotator: _Annotator | None = None
    missing = 0
    try:
        for time, frame, picture in _pictures(recording, vehicles, options):
            key = picture.vehicle, picture.camera
            if options.rate is not None and time < last.get(key, -np.inf) + 1.0 / options.rate - 1e-9:
                continue
            if frame is None:
                missing += 1
                continue
            last[key] = time
            record = recording.scenario_at(time)
            if annotator is None or annotator.record is not record:
                if annotator is not None:
                    annotator.renderer.release()
                with recording.scenario_spec(record) as spec:
                    annotator = _Annotator(record, spec)
            yield AnnotatedImage(time, picture, annotator.annotations(frame, picture))
    finally:
        if annotator is not None:
            annotator.renderer.release()
    if missing:
        recording.problems.append(
            f"{missing} images are left out: the recording does not have the Frames of their times"
        )


def _pictures(
    recording: Recording, vehicles: Sequence[str], options: ExportOptions
) -> Iterator[tuple[float, Frame | None, Picture]]:
    """Time in the recording [s] and picture of each image, and the Frame of its time, which may be an earlier one."""
    frames: deque[tuple[float, Frame]] = deque(maxlen=MAX_DELAY)
    known: dict[tuple[str, str], float] = {}
    begin = 0.0
    for time, frame in recording.moments(options.start, options.end):
        if not frames or frame.time < frames[-1][1].time:  # the first one, or a reset
            frames.clear()
            begin = frame.time
        frames.append((time, frame))
        for name in vehicles:
            if name not in frame.vehicles:
                continue
            images = cast("LazyImages", frame.vehicles[name].cameras)
            for camera, taken in images.times.items():
                is_known = taken < begin or known.get((name, camera)) == taken
                if is_known or (picture := images.picture(camera)) is None:
                    continue
                known[name, camera] = taken
                yield next(((t, f, picture) for t, f in reversed(frames) if f.time == taken), (time, None, picture))


class _Annotator:
    """Draws the objects of one scenario."""

    def __init__(self, record: ScenarioRecord, spec: ScenarioSpec) -> None:
        self.record = record
        self._compiled = compiled = compile_scenario(spec)
        self._instances = instances_of(compiled.map, compiled.vehicles, compiled.objects)
        self._scene = scene_of(compiled)
        self.renderer = Renderer(self._scene)

    def annotations(self, frame: Frame, picture: Picture) -> list[Annotation]:
        """The objects that an image of that Frame shows, without the vehicle of the camera."""
        seen, whole = self._masks(frame, picture)
        annotations: list[Annotation] = []
        for number, pixels in whole.items():
            instance, mask = self._instances[number - 1], seen == number
            is_own = instance.kind == "vehicle" and instance.name == picture.vehicle
            if is_own or np.count_nonzero(mask) < LEAST_PIXELS:
                continue
            light = frame.traffic_lights.get(instance.name) if instance.kind == "traffic_light" else None
            state = "" if light is None else light.state.name.lower()
            solid = self._solid(number, frame, picture)
            annotations.append(Annotation(number, instance, mask, pixels | mask, solid, state))
        return annotations

    def _masks(self, frame: Frame, picture: Picture) -> tuple[NDArray[np.uint16], dict[int, NDArray[np.bool_]]]:
        """What `Renderer.instances` returns, with the distortion of the lens."""
        lens, pose = picture.intrinsics, picture.pose
        ideal, places = ideal_pinhole(lens) if any(lens.distortion) else (lens, None)
        (x, y, z), (qw, qx, qy, qz) = pose.position.tolist(), pose.orientation.tolist()
        view = View((x, y, z), (qw, qx, qy, qz), ideal)
        camera = self._compiled.cameras.get(picture.vehicle, {}).get(picture.camera)
        if camera is not None:
            view = replace(view, near=camera.near, far=camera.far)
        seen, whole = self.renderer.instances(RenderState.of(frame), view)
        if places is None:
            return seen, whole
        columns, rows = np.moveaxis(np.round(places).astype(np.intp), -1, 0)
        return seen[rows, columns], {number: mask[rows, columns] for number, mask in whole.items()}

    def _solid(self, number: int, frame: Frame, picture: Picture) -> SolidBox:
        name, kind = self._instances[number - 1]
        middle, size, pose = self._extents[number - 1]
        if kind in ("vehicle", "box"):
            moved = frame.vehicles[name].pose if kind == "vehicle" else frame.objects[name].pose
            pose = moved.position, moved.orientation
        position, orientation = pose
        eye, looking = picture.pose.position, inverse(picture.pose.orientation)
        turn = np.reshape(rotation_from_quaternion(looking), (3, 3))
        center = turn @ (position + np.reshape(rotation_from_quaternion(orientation), (3, 3)) @ middle - eye)
        return SolidBox(center.tolist(), size.tolist(), [float(part) for part in compose(looking, orientation)])

    @cached_property
    def _extents(self) -> list[tuple[Floats, Floats, tuple[Floats, Floats]]]:
        """Middle and size of each object in its own axes [m], and the pose of an object of the map."""
        numbers = {name: number for number, name in enumerate(self._scene.map_objects, 1)}
        nodes: dict[int, list[AssetNode]] = {number: [] for number in numbers.values()}
        for node in self._scene.static.nodes:
            if number := instance_of(node.name, numbers):
                nodes[number].append(node)
        poses = [(np.array(own[0].position), np.array(own[0].orientation)) for own in nodes.values()]
        extents = [
            (*_extent(self._scene.static, own, rigid(*pose)), pose)
            for own, pose in zip(nodes.values(), poses, strict=True)
        ]
        still = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        moving = [*self._scene.vehicles, *self._scene.objects]
        return extents + [(*_extent(asset, asset.nodes, np.eye(4)), still) for asset in moving]


def _extent(asset: Asset, nodes: Sequence[AssetNode], origin: Floats) -> tuple[Floats, Floats]:
    """Middle and size of nodes of an asset at rest [m], in axes whose pose in those of the asset is `origin`."""
    skeleton, into = Skeleton(asset), np.linalg.inv(origin)
    bones = skeleton.pose(np.eye(4), signals_of(np.zeros((), VEHICLE)))
    points: list[Floats] = []
    for node in nodes:
        place = into @ bones[skeleton.bone_of[node.name]] @ skeleton.place_of[node.name]
        points += [surface.positions @ place[:3, :3].T + place[:3, 3] for surface in node.surfaces.get("full", ())]
    low, high = np.concatenate(points).min(0), np.concatenate(points).max(0)
    return 0.5 * (low + high), high - low
