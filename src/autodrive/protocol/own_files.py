"""Messages about the files of a user: opened, saved, imported from other programs and exported to them."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec

from autodrive.protocol.messages import MAX_TEXT, Coordinate, Name


class ImportTrack(msgspec.Struct, frozen=True, tag=True):
    """Replace the map by the track in a picture of a map, as `autodrive import track`; it is the edit of a `UseMap`.

    `picture`: a PNG or PGM file, or that file compressed with zlib. `text`: its YAML file of ROS map_server, with
    `resolution`, `origin` and `negate`. `start`: a place on the track where the start line is, in pixels from the upper
    left corner to the right and down; None: the straightest place of the largest free ring. `gap`: openings of the
    walls that are narrower are closed [m]. `is_reversed`: driven clockwise. The `text` of the Response has warnings
    about probable mistakes.
    """

    picture: Annotated[bytes, msgspec.Meta(max_length=MAX_TEXT)]
    text: Annotated[str, msgspec.Meta(max_length=10_000)]
    name: Name = "track"
    start: tuple[Coordinate, Coordinate] | None = None
    gap: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.0
    is_reversed: bool = False


class OpenFile(msgspec.Struct, frozen=True, tag=True):
    """Open a scenario, map or track: a file of the user's folder by its name, or the `text` of any file, called `name`.

    A map or track is the edit of a `UseMap`; a scenario is loaded as by a `LoadScenario`. A text names only vehicles,
    maps, modules, tracks and rules of the simulator and of the present scenario: no other file is read.
    """

    name: Name
    text: Annotated[str, msgspec.Meta(max_length=MAX_TEXT)] = ""


class ListFiles(msgspec.Struct, frozen=True, tag=True):
    """Request the files of the user's folder, in the `files` of the Response."""


class SaveFile(msgspec.Struct, frozen=True, tag=True):
    """Write the map or scenario with all edits into the user's folder, as NAME.yaml, with that title if there is one.

    A file of that name is replaced only if `replaces`. The `text` of the Response is the name of the file.
    """

    name: Name
    kind: Literal["map", "scenario"] = "map"
    title: Annotated[str, msgspec.Meta(max_length=200)] = ""
    replaces: bool = False


class ExportMap(msgspec.Struct, frozen=True, tag=True):
    """Request the map for map_server of ROS: the `picture` (PNG) and `text` (YAML, for NAME.png) of the Response.

    `resolution`: edge of a pixel [m]. Gaps between the ducts of a track are closed.
    """

    name: Name = "map"
    resolution: Annotated[float, msgspec.Meta(ge=0.001, le=1.0)] = 0.05


FileOperation: TypeAlias = ImportTrack | OpenFile | ListFiles | SaveFile | ExportMap

# -- from the server --------------------------------------------------------------------------------------------


class OwnFile(msgspec.Struct, frozen=True):
    """A file of the user's folder, and its title."""

    kind: Literal["scenario", "map", "track"]
    title: str
