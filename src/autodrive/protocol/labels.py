"""Semantic classes of the pixels of label images, and of the surfaces of maps."""

from enum import IntEnum


class Label(IntEnum):
    """Semantic class of a pixel, in the label image of a camera."""

    NOTHING = 0
    """The sky."""
    GROUND = 1
    LAWN = 2
    ROAD = 3
    KERB = 4
    EDGE_LINE = 5
    SEPARATION_LINE = 6
    STOP_LINE = 7
    CROSSING = 8
    BAY_LINE = 9
    WALL = 10
    BLOCK = 11
    BOX = 12
    SIGN = 13
    TRAFFIC_LIGHT = 14
    POST = 15
    VEHICLE = 16
