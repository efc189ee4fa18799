"""Makes the World of a scenario."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from autodrive.base.errors import SpecError
from autodrive.base.jit import announced
from autodrive.base.specs import SpecProblems, joined
from autodrive.base.suggest import with_suggestions
from autodrive.protocol.commands import check_seed
from autodrive.scenario import DEFAULT, ScenarioSpec
from autodrive.scenario.descriptions import Descriptions
from autodrive.scenario.files import read_scenario, with_own_sensors
from autodrive.world import World
from autodrive.world.compile import CompiledScenario, compile_specs

if TYPE_CHECKING:
    from autodrive.graphics.cameras.backend import CameraBackend


@with_suggestions
def make(
    scenario: str | Path | ScenarioSpec | Descriptions = DEFAULT,
    seed: int | None = None,
    *,
    cameras: bool | str | Callable[[CompiledScenario], CameraBackend] = False,
    engine: Literal["auto", "always"] = "auto",
) -> World:
    """The World of a scenario (name, file or Spec) in its initial state. Raises `SpecError`.

    `cameras`: False omits the cameras, which costs nothing. True, or the name of a quality
    (`autodrive.graphics.render.quality.NAMES`), renders each camera in the tick in which it is due, from exactly that
    state; raises `GlUnavailable` if OpenGL is not available. A function makes another camera backend, such as
    `autodrive.world.views.cameras.process_cameras`.

    `engine`: "auto" calls the contact engine only while something may touch; "always" calls it in every substep, which
    is slower and differs in the last bits only.

    What is probably a mistake, such as a vehicle outside the walls, is a warning of Python, except in a scenario that
    was edited.
    """
    descriptions = scenario if isinstance(scenario, Descriptions) else read_scenario(scenario)
    world = new_world(descriptions, seed, cameras=cameras, engine=engine)
    is_edit = descriptions is scenario and not descriptions.path  # the page shows its warnings
    for text in [] if is_edit else joined(world.warnings, descriptions.lines):
        warnings.warn(text, stacklevel=3)  # where `make` is called: `with_suggestions` is between
    return world


def new_world(
    scenario: str | Path | ScenarioSpec | Descriptions = DEFAULT,
    seed: int | None = None,
    *,
    cameras: bool | str | Callable[[CompiledScenario], CameraBackend] = False,
    engine: Literal["auto", "always"] = "auto",
) -> World:
    """Make a World as `make` does, but without showing `World.warnings`, for callers that show them in another way."""
    descriptions = scenario if isinstance(scenario, Descriptions) else read_scenario(scenario)
    if seed is not None:
        check_seed(seed)
        seeded = descriptions.specs.scenario.model_copy(update={"seed": int(seed)})
        descriptions = replace(descriptions, specs=replace(descriptions.specs, scenario=seeded))
    return world_of(compile_scenario(descriptions), cameras=cameras, engine=engine)


def world_of(
    compiled: CompiledScenario,
    *,
    cameras: bool | str | Callable[[CompiledScenario], CameraBackend] = False,
    engine: Literal["auto", "always"] = "auto",
) -> World:
    """The World of a compiled scenario, which belongs to it."""
    with announced():
        return World(compiled, _camera_backend(compiled, cameras), engine=engine)


def compile_scenario(scenario: str | Path | ScenarioSpec | Descriptions) -> CompiledScenario:
    """Read a scenario (name, file or Spec) and compile it. Raises `SpecError` with all errors and their places."""
    descriptions = scenario if isinstance(scenario, Descriptions) else read_scenario(scenario)
    try:
        return compile_specs(with_own_sensors(descriptions.specs))
    except SpecProblems as error:
        raise SpecError(joined(error.problems, descriptions.lines), descriptions.path) from None


def _camera_backend(
    compiled: CompiledScenario, cameras: bool | str | Callable[[CompiledScenario], CameraBackend]
) -> CameraBackend | None:
    if cameras is False or not any(compiled.cameras.values()):
        return None
    if callable(cameras):
        return cameras(compiled)
    from autodrive.graphics.cameras.tick_cameras import TickCameras
    from autodrive.world.views.cameras import camera_rig

    return TickCameras(camera_rig(compiled, "auto" if cameras is True else cameras))
