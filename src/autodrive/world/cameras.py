"""The cameras of a world: their rig, which is all that their images are made of, and the process that renders them."""

from __future__ import annotations

from fractions import Fraction

from autodrive.graphics.cameras.process import CameraProcess
from autodrive.graphics.cameras.rig import CameraRig, CameraSlot
from autodrive.graphics.meshes.store import scene_of
from autodrive.world.compile import CompiledScenario


def camera_rig(compiled: CompiledScenario, quality: str = "auto") -> CameraRig:
    """The cameras of that world and the scene that they see."""
    slots = [
        CameraSlot(row, vehicle, camera, spec)
        for row, (vehicle, cameras) in enumerate(compiled.cameras.items())
        for camera, spec in cameras.items()
    ]
    return CameraRig(
        scene=scene_of(compiled),
        slots=tuple(slots),
        substep=Fraction(str(compiled.spec.substep)),
        substeps=compiled.spec.substeps,
        quality=quality,
    )


def camera_process(compiled: CompiledScenario, quality: str = "auto", *, is_wanted: bool = True) -> CameraProcess:
    """A process that renders the cameras of that world."""
    return CameraProcess(camera_rig(compiled, quality), is_wanted=is_wanted)
