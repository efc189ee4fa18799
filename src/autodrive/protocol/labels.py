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


COLOURS = {
    Label.NOTHING: "#000000",
    Label.GROUND: "#7a7a70",
    Label.LAWN: "#3f9b3a",
    Label.ROAD: "#804080",
    Label.KERB: "#c4a8e0",
    Label.EDGE_LINE: "#ffffff",
    Label.SEPARATION_LINE: "#ffe14d",
    Label.STOP_LINE: "#ff5fa2",
    Label.CROSSING: "#5fd6ff",
    Label.BAY_LINE: "#b8f0b0",
    Label.WALL: "#9c6b3c",
    Label.BLOCK: "#46587a",
    Label.BOX: "#ff8c1a",
    Label.SIGN: "#dcdc00",
    Label.TRAFFIC_LIGHT: "#ff2a2a",
    Label.POST: "#00a0a0",
    Label.VEHICLE: "#2f6bff",
}
"""Colour of each label in pictures for people: '#rrggbb'."""
