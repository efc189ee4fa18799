"""Maps: modules (pieces of road, lawn, boxes) put together to a world to drive in."""

from autodrive.maps.lanes import Lane, LaneGraph, LanePoint
from autodrive.maps.map import BoxPlacement, Map, MapSpec, Marking, StaticShape, Surface, compile_map, load_map
from autodrive.maps.module import DRIVING_SIDE, Module, ModuleSpec, Port, load_module

__all__ = [
    "DRIVING_SIDE",
    "BoxPlacement",
    "Lane",
    "LaneGraph",
    "LanePoint",
    "Map",
    "MapSpec",
    "Marking",
    "Module",
    "ModuleSpec",
    "Port",
    "StaticShape",
    "Surface",
    "compile_map",
    "load_map",
    "load_module",
]
