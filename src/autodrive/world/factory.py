"""Makes the World of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from autodrive.base.specs import Source, find, source
from autodrive.protocol.commands import check_seed
from autodrive.scenario import DEFAULT, ScenarioSpec, load_scenario
from autodrive.world import World
from autodrive.world.compile import Compiled, compile_scenario

if TYPE_CHECKING:
    from autodrive.graphics.cameras.backend import CameraBackend


def make(
    scenario: str | Path | ScenarioSpec = DEFAULT,
    seed: int | None = None,
    *,
    cameras: bool | str | Callable[[Compiled], CameraBackend] = False,
    engine: Literal["auto", "always"] = "auto",
) -> World:
    """The World of a scenario (name, file or Spec) in its initial state. Raises `SpecError`.

    `cameras`: False omits the cameras, which costs nothing. True, or the name of a quality
    (`autodrive.graphics.render.quality.NAMES`), renders each camera in the tick in which it is due, from exactly that
    state; raises `GlUnavailable` if OpenGL is not available. A function makes another camera backend, such as
    `autodrive.world.cameras.process_cameras`.

    `engine`: "auto" calls the contact engine only while something may touch; "always" calls it in every substep, which
    is slower and differs in the last bits only.
    """
    spec, text = read_scenario(scenario)
    if seed is not None:
        check_seed(seed)
        spec = spec.model_copy(update={"seed": int(seed)})
    compiled = compile_scenario(spec, text)
    return World(compiled, _camera_backend(compiled, cameras), engine=engine)


def read_scenario(scenario: str | Path | ScenarioSpec) -> tuple[ScenarioSpec, Source | None]:
    """The Spec, and the text that it comes from, if any."""
    if isinstance(scenario, ScenarioSpec):
        return scenario, None
    path = find("scenario", scenario)
    return load_scenario(path), source(path)


def _camera_backend(
    compiled: Compiled, cameras: bool | str | Callable[[Compiled], CameraBackend]
) -> CameraBackend | None:
    if cameras is False or not any(compiled.cameras.values()):
        return None
    if callable(cameras):
        return cameras(compiled)
    from autodrive.graphics.cameras.tick_cameras import TickCameras
    from autodrive.world.cameras import camera_rig

    return TickCameras(camera_rig(compiled, "auto" if cameras is True else cameras))
