"""Maps: modules (pieces of road, lawn, boxes) that are placed and joined to form a drivable environment."""

from autodrive.scenario.maps.area import drivable_edges, is_inside
from autodrive.scenario.maps.lanes import Lane, LaneGraph, LanePoint
from autodrive.scenario.maps.map import Map, MapSpec, Marking, ParkingBay, Surface, load_map, load_module
from autodrive.scenario.maps.module import DRIVING_SIDE, Module, ModuleSpec, Port
from autodrive.scenario.maps.props import Prop
from autodrive.scenario.maps.solids import BoxPlacement, StaticShape

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
    "drivable_edges",
    "is_inside",
    "load_map",
    "load_module",
]
