"""A simulator for scaled autonomous vehicles: `make(scenario)` returns a `World`, `World.step(commands)` a `Frame`.

The names below are the public API. Each is imported on first use, so that `import autodrive` is fast and loads MuJoCo,
Numba and OpenGL only when a world is made.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec
    from types import ModuleType

    from autodrive.base.errors import AutodriveError as AutodriveError
    from autodrive.base.errors import CommandError as CommandError
    from autodrive.base.errors import EngineError as EngineError
    from autodrive.base.errors import NoImageError as NoImageError
    from autodrive.base.errors import SensorError as SensorError
    from autodrive.base.errors import SnapshotError as SnapshotError
    from autodrive.base.errors import SpecError as SpecError
    from autodrive.base.errors import WorldInUseError as WorldInUseError
    from autodrive.connect.client import Client as Client
    from autodrive.connect.client import NoSimulatorError as NoSimulatorError
    from autodrive.experiments.identification import Identification as Identification
    from autodrive.experiments.identification import IdentificationError as IdentificationError
    from autodrive.experiments.identification import identify as identify
    from autodrive.graphics.render.gl import GlUnavailable as GlUnavailable
    from autodrive.protocol.messages import BackOnRoad as BackOnRoad
    from autodrive.protocol.messages import CameraImage as CameraImage
    from autodrive.protocol.messages import CameraIntrinsics as CameraIntrinsics
    from autodrive.protocol.messages import CheckpointPassed as CheckpointPassed
    from autodrive.protocol.messages import Collision as Collision
    from autodrive.protocol.messages import Command as Command
    from autodrive.protocol.messages import EncoderReading as EncoderReading
    from autodrive.protocol.messages import Frame as Frame
    from autodrive.protocol.messages import Headlights as Headlights
    from autodrive.protocol.messages import ImuReading as ImuReading
    from autodrive.protocol.messages import Indicators as Indicators
    from autodrive.protocol.messages import IpsReading as IpsReading
    from autodrive.protocol.messages import LapCompleted as LapCompleted
    from autodrive.protocol.messages import LidarScan as LidarScan
    from autodrive.protocol.messages import Lights as Lights
    from autodrive.protocol.messages import ObjectFrame as ObjectFrame
    from autodrive.protocol.messages import OffRoad as OffRoad
    from autodrive.protocol.messages import OwnReading as OwnReading
    from autodrive.protocol.messages import Pose as Pose
    from autodrive.protocol.messages import RacePenalty as RacePenalty
    from autodrive.protocol.messages import RaceState as RaceState
    from autodrive.protocol.messages import RaceStatus as RaceStatus
    from autodrive.protocol.messages import RaceStatusChanged as RaceStatusChanged
    from autodrive.protocol.messages import RangeReading as RangeReading
    from autodrive.protocol.messages import SetBack as SetBack
    from autodrive.protocol.messages import TailLights as TailLights
    from autodrive.protocol.messages import VehicleFrame as VehicleFrame
    from autodrive.protocol.messages import WheelsReading as WheelsReading
    from autodrive.protocol.messages import WrongWay as WrongWay
    from autodrive.scenario import BoxSpec as BoxSpec
    from autodrive.scenario import Scenario as Scenario
    from autodrive.scenario import ScenarioSpec as ScenarioSpec
    from autodrive.scenario import VehiclePlacement as VehiclePlacement
    from autodrive.scenario import load_scenario as load_scenario
    from autodrive.scenario.maps.map import Map as Map
    from autodrive.scenario.maps.map import MapSpec as MapSpec
    from autodrive.scenario.maps.map import load_map as load_map
    from autodrive.scenario.vehicles.spec import VehicleSpec as VehicleSpec
    from autodrive.scenario.vehicles.spec import load_vehicle as load_vehicle
    from autodrive.world import World as World
    from autodrive.world.batch import BatchWorld as BatchWorld
    from autodrive.world.factory import make as make
    from autodrive.world.simulation import Simulation as Simulation
    from autodrive.world.simulation import Sink as Sink

_HOME = {
    "world.batch": ("BatchWorld",),
    "connect.client": ("Client", "NoSimulatorError"),
    "base.errors": (
        "AutodriveError",
        "CommandError",
        "EngineError",
        "NoImageError",
        "SensorError",
        "SnapshotError",
        "SpecError",
        "WorldInUseError",
    ),
    "protocol.messages": (
        "BackOnRoad",
        "CameraImage",
        "CameraIntrinsics",
        "CheckpointPassed",
        "Collision",
        "Command",
        "EncoderReading",
        "Frame",
        "Headlights",
        "ImuReading",
        "Indicators",
        "IpsReading",
        "LapCompleted",
        "LidarScan",
        "Lights",
        "ObjectFrame",
        "OffRoad",
        "OwnReading",
        "Pose",
        "RacePenalty",
        "RaceState",
        "RaceStatus",
        "RaceStatusChanged",
        "RangeReading",
        "SetBack",
        "TailLights",
        "VehicleFrame",
        "WheelsReading",
        "WrongWay",
    ),
    "experiments.identification": ("Identification", "IdentificationError", "identify"),
    "scenario.maps.map": ("Map", "MapSpec", "load_map"),
    "graphics.render.gl": ("GlUnavailable",),
    "scenario": ("BoxSpec", "Scenario", "ScenarioSpec", "VehiclePlacement", "load_scenario"),
    "world.simulation": ("Simulation", "Sink"),
    "scenario.vehicles.spec": ("VehicleSpec", "load_vehicle"),
    "world.factory": ("make",),
    "world": ("World",),
}
"""Module of this package -> the public names that it defines."""

_home_of = {name: module for module, names in _HOME.items() for name in names}

_SIMULATOR_DEPENDENCIES = {
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
"""Import names of the packages that autodrive-simulator depends on and autodrive-client does not."""

__version__ = "0.1.0"
__all__ = [*_home_of]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _home_of:
        raise AttributeError(f"module 'autodrive' has no attribute '{name}'")
    home = f"autodrive.{_home_of[name]}"
    try:
        module = importlib.import_module(home)
    except ModuleNotFoundError as error:
        if _is_client_only(home, error.name or ""):
            raise ImportError(
                f"autodrive.{name} needs the simulator, and only autodrive-client is installed. Install the "
                "distribution autodrive-simulator; in a checkout of its repository, run:  pip install ."
            ) from None
        raise
    value = getattr(module, name)
    globals()[name] = value
    return value


def _is_client_only(home: str, missing: str) -> bool:
    """Whether a module is missing because autodrive-client is installed without the simulator.

    The client leaves out whole modules: `missing` is then `home` or a package that contains it. An editable
    installation of the client has all modules, but not the dependencies of the simulator.
    """
    return f"{home}.".startswith(f"{missing}.") or missing.partition(".")[0] in _SIMULATOR_DEPENDENCIES


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


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
        if error.name != "autodrive.experiments.envs":  # autodrive-client has none
            raise
    else:
        registration.register()


def _register_now_or_later() -> None:
    if "gymnasium" in sys.modules:
        _register_environments()
    else:
        sys.meta_path.insert(0, _WhenGymnasiumIsImported())


_register_now_or_later()
