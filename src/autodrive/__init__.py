"""A simulator for scaled autonomous vehicles: `make(scenario)` returns a `World`, `World.step(commands)` a `Frame`.

The names below are the public API. Each is imported on first use, so that `import autodrive` is fast and loads MuJoCo,
Numba and OpenGL only when a world is made.
"""

from __future__ import annotations

import importlib
import sys
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import lazy_loader

from autodrive.base.version import __version__ as __version__

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec
    from types import ModuleType

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
"""The names of `__init__.pyi`."""

_LEFT_OUT = {f"autodrive.{group}" for group in ("physics", "scenario", "graphics", "world", "experiments")}
"""Groups with public names that autodrive-client leaves out."""

_SIMULATOR_DEPENDENCIES = {
    "backports",
    "google",
    "manifold3d",
    "moderngl",
    "mujoco",
    "numba",
    "pydantic",
    "resvg_py",
    "rich",
    "shapely",
    "trimesh",
    "typer",
    "uvicorn",
    "uvloop",
    "yaml",
}
"""Import names of the packages that autodrive-simulator depends on and autodrive-client does not; an editable
installation of the client has all modules, but not these."""


def __getattr__(name: str) -> Any:
    try:
        value = _public(name)
    except AttributeError:
        close = get_close_matches(name, __all__, n=1)
        hint = f". Did you mean '{close[0]}'?" if close else ""
        raise AttributeError(f"module 'autodrive' has no attribute '{name}'{hint}") from None
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if missing in _LEFT_OUT or missing.partition(".")[0] in _SIMULATOR_DEPENDENCIES:
            raise ImportError(
                f"autodrive.{name} needs the simulator, and only autodrive-client is installed. Install the "
                "distribution autodrive-simulator; in a checkout of its repository, run:  pip install ."
            ) from None
        raise
    globals()[name] = value
    return value


# -- former import paths -----------------------------------------------------------------------------------------------

_FORMER = {
    "assets": "graphics.assets",
    "batch": "world.batch",
    "bridge": "connect.bridge",
    "cameras": "graphics.cameras",
    "cameras.batch_camera": "world.batch_camera",
    "campaigns": "experiments.campaigns",
    "client": "connect.client",
    "devkit.server": "connect.devkit.server",
    "devkit.vehicles": "connect.devkit.vehicles",
    "elementary": "base.elementary",
    "envs": "experiments.envs",
    "errors": "base.errors",
    "exports": "recording.exports",
    "factory": "world.factory",
    "identification": "experiments.identification",
    "maps": "scenario.maps",
    "model": "physics.model",
    "policies": "experiments.policies",
    "racing": "world.racing",
    "render": "graphics.render",
    "replay": "recording.replay",
    "sensors": "physics.sensors",
    "simulation": "world.simulation",
    "specs": "base.yaml_files",
    "testing": "connect.conformance",
    "tracks": "scenario.tracks",
    "vehicles": "scenario.vehicles",
}
"""Paths that earlier documentation names -> where the module is now."""


class _FormerPaths:
    """Finds a module by its former path: the same module object, which has its present name."""

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Nothing but former paths."""
        if not name.startswith("autodrive."):
            return None
        former, inner = name.removeprefix("autodrive."), ""
        while former and former not in _FORMER:
            former, _, last = former.rpartition(".")
            inner = f".{last}{inner}"
        if not former:
            return None
        from importlib.util import find_spec, spec_from_loader  # noqa: PLC0415  as below

        present = f"autodrive.{_FORMER[former]}{inner}"
        return spec_from_loader(name, self, origin=present) if find_spec(present) else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module at its present place."""
        module = importlib.import_module(str(spec.origin))
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """It has been executed; importing it by a former path leaves it as it was."""
        assert module.__spec__ is not None
        module.__spec__ = module.__spec__.loader_state


sys.meta_path.insert(0, _FormerPaths())  # type: ignore[arg-type]

# -- learning environments ---------------------------------------------------------------------------------------------


class _WhenGymnasiumIsImported:
    """Registers the learning environments after the import of Gymnasium, if that comes after ours.

    `gymnasium.make("autodrive:...")` imports this package, which has no effect if it has been imported before, and
    Gymnasium has no entry points. So this finder of modules finds Gymnasium as the others do, and adds a last step.
    """

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Nothing but Gymnasium."""
        if name != "gymnasium":
            return None
        from importlib.util import find_spec  # noqa: PLC0415  it takes longer than the rest of this module

        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            _register_environments()

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


def _register_environments() -> None:
    try:
        registration = importlib.import_module("autodrive.experiments.envs.registration")
    except ModuleNotFoundError as error:
        if error.name not in _LEFT_OUT:  # autodrive-client has none
            raise
    else:
        registration.register()


def _register_now_or_later() -> None:
    if "gymnasium" in sys.modules:
        _register_environments()
    else:
        sys.meta_path.insert(0, _WhenGymnasiumIsImported())


_register_now_or_later()
