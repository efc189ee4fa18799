"""Messages about the files of a user: pictures of maps that become tracks."""

from __future__ import annotations

from typing import Annotated, TypeAlias

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


FileOperation: TypeAlias = ImportTrack
