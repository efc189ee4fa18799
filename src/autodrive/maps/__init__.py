"""Maps: modules (pieces of road, lawn, boxes) that are placed and joined to form a drivable environment."""

from autodrive.maps.area import drivable_edges, is_inside
from autodrive.maps.lanes import Lane, LaneGraph, LanePoint
from autodrive.maps.map import Map, MapSpec, Marking, ParkingBay, Surface, compile_map, load_map
from autodrive.maps.module import DRIVING_SIDE, Module, ModuleSpec, Port, load_module
from autodrive.maps.props import Prop
from autodrive.maps.solids import BoxPlacement, StaticShape

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
    "ParkingBay",
    "Port",
    "Prop",
    "StaticShape",
    "Surface",
    "compile_map",
    "drivable_edges",
    "is_inside",
    "load_map",
    "load_module",
]
