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
