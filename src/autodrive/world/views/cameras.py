"""The cameras of a world: their rig, which is all that their images are made of, and the process that renders them."""

from __future__ import annotations

from autodrive.base.exact_fraction import exact_fraction
from autodrive.graphics.cameras.process_cameras import ProcessCameras
from autodrive.graphics.cameras.rig import CameraRig, CameraSlot, SceneContents
from autodrive.world import World
from autodrive.world.compile import CompiledScenario


def camera_rig(compiled: CompiledScenario, quality: str = "auto") -> CameraRig:
    """The cameras of that world and the scene that they see."""
    slots = [
        CameraSlot(row, vehicle, camera, spec)
        for row, (vehicle, cameras) in enumerate(compiled.cameras.items())
        for camera, spec in cameras.items()
    ]
    return CameraRig(
        SceneContents(compiled.map, compiled.vehicles, compiled.boxes),
        quality,
        slots=tuple(slots),
        substep=exact_fraction(compiled.spec.substep),
        substeps=compiled.spec.substeps,
    )


def scene_rig(world: World, quality: str = "auto", *, paints_all: bool = False) -> CameraRig:
    """The scene of a world as it is now, without its cameras; `paints_all`: see `SceneContents`."""
    contents = SceneContents(world.map, world.vehicle_specs, list(world.boxes.values()), paints_all)
    return CameraRig(contents, quality)


def process_cameras(compiled: CompiledScenario, quality: str = "auto", *, is_wanted: bool = True) -> ProcessCameras:
    """A process that renders the cameras of that world."""
    return ProcessCameras(camera_rig(compiled, quality), is_wanted=is_wanted)
