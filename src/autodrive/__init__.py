"""A simulator for scaled autonomous vehicles: `make(scenario)` gives a `World`, `World.step(commands)` a `Frame`.

The names below are the public ones. Each is imported when it is first used, so that `import autodrive` is light: no
MuJoCo, Numba or GL before a world is made.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from autodrive.client import Client as Client
    from autodrive.client import NoSimulatorError as NoSimulatorError
    from autodrive.errors import AutodriveError as AutodriveError
    from autodrive.errors import CommandError as CommandError
    from autodrive.errors import EngineError as EngineError
    from autodrive.errors import SpecError as SpecError
    from autodrive.maps.map import Map as Map
    from autodrive.maps.map import MapSpec as MapSpec
    from autodrive.maps.map import load_map as load_map
    from autodrive.protocol.messages import BackOnRoad as BackOnRoad
    from autodrive.protocol.messages import CameraImage as CameraImage
    from autodrive.protocol.messages import CameraIntrinsics as CameraIntrinsics
    from autodrive.protocol.messages import Collision as Collision
    from autodrive.protocol.messages import Command as Command
    from autodrive.protocol.messages import EncoderReading as EncoderReading
    from autodrive.protocol.messages import Frame as Frame
    from autodrive.protocol.messages import Headlights as Headlights
    from autodrive.protocol.messages import ImuReading as ImuReading
    from autodrive.protocol.messages import Indicators as Indicators
    from autodrive.protocol.messages import IpsReading as IpsReading
    from autodrive.protocol.messages import LidarScan as LidarScan
    from autodrive.protocol.messages import Lights as Lights
    from autodrive.protocol.messages import ObjectFrame as ObjectFrame
    from autodrive.protocol.messages import OffRoad as OffRoad
    from autodrive.protocol.messages import Pose as Pose
    from autodrive.protocol.messages import TailLights as TailLights
    from autodrive.protocol.messages import VehicleFrame as VehicleFrame
    from autodrive.protocol.messages import WheelsReading as WheelsReading
    from autodrive.render.gl import GlUnavailable as GlUnavailable
    from autodrive.scenario import ScenarioSpec as ScenarioSpec
    from autodrive.scenario import load_scenario as load_scenario
    from autodrive.simulation import Simulation as Simulation
    from autodrive.simulation import Sink as Sink
    from autodrive.vehicles.spec import VehicleSpec as VehicleSpec
    from autodrive.vehicles.spec import load_vehicle as load_vehicle
    from autodrive.world import World as World
    from autodrive.world import make as make

_HOME = {
    "client": ("Client", "NoSimulatorError"),
    "errors": ("AutodriveError", "CommandError", "EngineError", "SpecError"),
    "protocol.messages": (
        "BackOnRoad",
        "CameraImage",
        "CameraIntrinsics",
        "Collision",
        "Command",
        "EncoderReading",
        "Frame",
        "Headlights",
        "ImuReading",
        "Indicators",
        "IpsReading",
        "LidarScan",
        "Lights",
        "ObjectFrame",
        "OffRoad",
        "Pose",
        "TailLights",
        "VehicleFrame",
        "WheelsReading",
    ),
    "maps.map": ("Map", "MapSpec", "load_map"),
    "render.gl": ("GlUnavailable",),
    "scenario": ("ScenarioSpec", "load_scenario"),
    "simulation": ("Simulation", "Sink"),
    "vehicles.spec": ("VehicleSpec", "load_vehicle"),
    "world": ("World", "make"),
}
"""Module of this package -> the public names that live there."""

_home_of = {name: module for module, names in _HOME.items() for name in names}

__version__ = "0.1.0"
__all__ = [*_home_of]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _home_of:
        raise AttributeError(f"module 'autodrive' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"autodrive.{_home_of[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
