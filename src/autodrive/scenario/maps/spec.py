"""MapSpec: the file of a map, with placed modules, walls, blocks and signs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from autodrive.base.specs import Coordinate, Degrees, Described, Length, Mass, Name, RuleError, Spec
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.light_programs import MAX_PROGRAMS, LightProgramSpec
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.props import PropSpec
from autodrive.scenario.maps.shapes import Extent, Pose, Shapes
from autodrive.scenario.maps.solids import BlockSpec, WallSpec
from autodrive.scenario.tracks.track import TrackSpec

MAX_PLACEMENTS = 1000
MAX_STATICS = 2000
"""Most solids of a map: points of walls, blocks, and parts (two each) of signs and traffic lights."""


class Placement(Spec):
    """Pose of a module: x, y [m] and yaw of the centre of its footprint."""

    module: str
    name: Name = ""
    x: Coordinate
    y: Coordinate
    yaw_deg: Degrees = 0.0
    open: bool | tuple[str, ...] = False
    """Ports that may stay unconnected: True for all, or their names."""
    length: Extent | None = None
    """Terrain and boxes only: replaces the length of the module [m]."""
    width: Extent | None = None
    height: Length | None = None
    """Boxes only [m]."""
    z: float = Field(default=0.0, ge=0.0, le=1e4)
    """Boxes only: height of the underside above ground [m]."""
    mass: Mass | None = None
    """Boxes only [kg]."""

    @property
    def pose(self) -> Pose:
        """Pose of the origin of the module."""
        return self.x, self.y, self.yaw_deg * DEGREE


Friction: TypeAlias = Annotated[float, Field(ge=0.0, le=100.0)]


class GroundSpec(Spec):
    """The floor under everything: the plane z = 0."""

    length: Extent = 20.0
    """Drawn extent along x [m]; the plane itself is infinite."""
    width: Extent = 20.0
    """Drawn extent along y [m]."""
    friction: Friction = 0.6
    """Coulomb coefficient between the ground and bodies such as boxes (Unity's default material)."""
    grip: Friction = 1.0
    """Factor on the friction of the tyres, 1 on a dry road; the weather multiplies it."""
    surface: Literal["asphalt", "concrete", "gravel", "earth"] = "asphalt"
    """What water and snow do to it, unless the file of the vehicle has `wheels.weather`."""


class MapSpec(Spec):
    """A map: placed modules and the solid objects around them."""

    title: str
    note: str = ""
    is_draft: bool = False
    """True: it is being built; ports without a fitting neighbour and modules that overlap are warnings."""
    ground: GroundSpec = GroundSpec()
    paved: Shapes = ()
    """Drivable ground in addition to the roads of the modules."""
    placements: Annotated[tuple[Placement, ...], Field(max_length=MAX_PLACEMENTS)] = ()
    walls: tuple[WallSpec, ...] = ()
    blocks: tuple[BlockSpec, ...] = ()
    props: tuple[PropSpec, ...] = ()
    light_programs: Annotated[dict[str, LightProgramSpec], Field(max_length=MAX_PROGRAMS)] = Field(default_factory=dict)
    """Programs of the traffic lights, by name: one for each intersection."""

    @model_validator(mode="after")
    def _is_small_enough(self) -> MapSpec:
        count = sum(len(wall.points) for wall in self.walls) + len(self.blocks) + 2 * len(self.props)
        if count > MAX_STATICS:
            text = f"{count} points of walls, blocks, and parts of signs and lights; at most {MAX_STATICS} are possible"
            raise RuleError([(("walls" if self.walls else "blocks",), text)])
        return self


@dataclass(frozen=True, eq=False)
class DescribedMap(Described[MapSpec | TrackSpec]):
    """What the files of a map or track and of its modules say."""

    placements: tuple[tuple[int, Placement], ...] = ()
    """Numbers, from 1, and Specs: all, or the valid ones of a file that is not valid."""
    modules: Mapping[str, Described[ModuleSpec]] = field(default_factory=dict)
    """Files of the modules, by name in the placements."""

    @property
    def is_draft(self) -> bool:
        """Whether it is being built."""
        return self.spec_or_none is not None and self.spec_or_none.is_draft
