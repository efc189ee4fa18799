"""Scenarios: a map, vehicles with their start poses and sensor settings, boxes, light, tick and seed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from msgspec import structs
from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    FieldSerializationInfo,
    Tag,
    field_serializer,
    field_validator,
    model_validator,
)

from autodrive.base.exact_fraction import exact_fraction, whole_parts
from autodrive.base.specs import Coordinate, Degrees, Length, Mass, RuleError, Spec, TimeOfDay, is_yaml
from autodrive.base.suggest import suggest
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.protocol.messages import Weather
from autodrive.protocol.weather import PRESETS
from autodrive.scenario.maps.light_programs import MAX_PROGRAMS, LightProgramSpec
from autodrive.scenario.maps.spec import MapSpec
from autodrive.scenario.tracks.track import TrackSpec
from autodrive.scenario.v2x import V2xSpec
from autodrive.scenario.vehicles.spec import GRAVITY

DEFAULT = "mini_map"
"""Name of the scenario that runs if none is named."""
START = "traffic"
"""Name of the scenario that runs behind the start screen of the page."""
FACTOR_LIMITS = {
    "mass": (0.1, 10.0),
    "grip": (0.01, 10.0),
    "noise": (0.0, 100.0),
    "drive": (0.1, 10.0),
    "trim": (-0.2, 0.2),
}
"""Least and greatest factor of a vehicle, and trim of its steering [rad], see `VehiclePlacement`."""
NEUTRAL = {"mass": 1.0, "grip": 1.0, "noise": 1.0, "drive": 1.0, "trim": 0.0}
"""Values of the factors and of the trim with which a vehicle is that of its file."""
FACTOR_FIELDS = {name: "steering_trim" if name == "trim" else f"{name}_factor" for name in NEUTRAL}
"""Field of `VehiclePlacement` of each of them."""
SHORTEST_SUBSTEP = 1e-5
"""Least length of a substep [s]."""
FINEST = 10**9
"""Greatest denominator of a substep [s]: then the numbers of a long run fit into 64 bits."""
MAX_VEHICLES = 100
"""Most vehicles of a scenario."""
MAX_BOXES = 1000
"""Most boxes of a scenario, with those of its map."""


def _class_in_file(text: str) -> str:
    file, _, name = text.rpartition(":")
    if not file.endswith(".py") or not name.isidentifier():
        raise ValueError(f"must be FILE.py:CLASS, such as my_radar.py:Radar, not '{text[:100]}'")
    return text


OwnSensorClass: TypeAlias = Annotated[str, AfterValidator(_class_in_file)]
"""A class in a Python file: 'my_radar.py:Radar'."""


class VehiclePlacement(Spec):
    """A vehicle and its pose at the start, on the ground."""

    type: str = "nigel"
    """Name or file of the VehicleSpec."""
    x: Coordinate = 0.0
    """Position of the rear axle centre [m]."""
    y: Coordinate = 0.0
    """[m]."""
    yaw_deg: Degrees = 0.0
    """Heading, left positive [degree]."""
    has_realistic_sensors: bool = False
    """True: the sensors have the noise of their data sheets instead of that of the vehicle's file."""
    is_autonomous: bool = True
    """Driving mode at the start: a script (True) or a person (False) drives."""
    mass_factor: float = Field(default=1.0, ge=0.1, le=10.0)
    """Multiplies mass and moments of inertia of the vehicle's file."""
    grip_factor: float = Field(default=1.0, ge=0.01, le=10.0)
    """Multiplies the friction of its tyres."""
    noise_factor: float = Field(default=1.0, ge=0.0, le=100.0)
    """Multiplies the standard deviations of the noise of all its sensors; resolutions stay."""
    drive_factor: float = Field(default=1.0, ge=0.1, le=10.0)
    """Multiplies the torque of its motors at any throttle, such as by the charge of a battery; in speed control the
    largest one."""
    steering_trim: float = Field(default=0.0, ge=-0.2, le=0.2)
    """Angle that is added to that of its steered wheels, left positive [rad]."""
    surface: str | None = None
    """Floor of `wheels.surfaces` of the vehicle's file; null: its tyres have the friction of the file."""
    sensors: dict[str, SensorSettings] = Field(default_factory=dict)
    """Settings by name of a sensor ('encoders', 'ips', 'imu', 'lidar', 'range') or camera, instead of the file's."""
    own_sensors: dict[str, OwnSensorClass] = Field(default_factory=dict)
    """Sensors of your own by name: 'my_radar.py:Radar' is a class in a Python file, from the folder of the scenario."""

    @property
    def yaw(self) -> float:
        """[rad]."""
        return math.radians(self.yaw_deg)

    def with_factors(self, factors: Mapping[str, float]) -> VehiclePlacement:
        """The placement with factors and a trim in addition to its own, by their names in `NEUTRAL`."""
        before = {name: getattr(self, FACTOR_FIELDS[name]) for name in factors}
        both = {name: before[name] + more if name == "trim" else before[name] * more for name, more in factors.items()}
        return self.model_copy(update={FACTOR_FIELDS[name]: value for name, value in both.items()})


class BoxSpec(Spec):
    """A movable box besides those of the map."""

    x: Coordinate
    """Centre [m]."""
    y: Coordinate
    """Centre [m]."""
    z: Coordinate | None = None
    """Centre [m]; left out: it stands on the ground."""
    yaw_deg: Degrees = 0.0
    """[degree]."""
    size: tuple[Length, Length, Length] = (0.1, 0.1, 0.1)
    """Length, width, height [m]."""
    mass: Mass = 0.1
    """[kg]."""

    @model_validator(mode="after")
    def _above_ground(self) -> BoxSpec:
        if self.z is not None and self.z < self.size[2] / 2 - 1e-6:
            raise ValueError(
                f"z is the height of the centre of the box, at least half the height of the box, {self.size[2]} m"
            )
        return self


class RaceSpec(Spec):
    """A race of all vehicles of a scenario."""

    track: str = ""
    """Name or file of the track; left out: the map is the track."""
    rules: str = "practice"
    """Name or file of the rules."""
    laps: int | None = Field(default=None, ge=1, le=1000)
    """Laps that count, instead of those of the rules."""


class TrafficSpec(Spec):
    """Cars that drive themselves on the lanes of the map: they keep distance, obey lights and signs, and give way."""

    cars: int = Field(default=0, ge=0, le=50)
    """How many; their names are traffic_1, traffic_2, ..."""
    type: str = "nigel"
    """Name or file of the VehicleSpec; its throttle sets a speed."""
    speed: float = Field(default=0.4, ge=0.05, le=10.0)
    """Speed at which the fastest drivers like to drive [m/s], at most the top speed of the vehicle; the slowest: 85
    %."""

    @property
    def names(self) -> list[str]:
        """Names of the cars."""
        return [f"traffic_{k}" for k in range(1, self.cars + 1)]


def is_track(tree: Any) -> bool:
    """Whether the values of a map's file are those of a track."""
    return isinstance(tree, dict) and bool({"centre_line", "points"} & tree.keys())


def _type_of_map(value: Any) -> str:
    if isinstance(value, TrackSpec) or is_track(value):
        return "dict[str, track]"
    return "dict[str, Any]" if isinstance(value, dict | MapSpec) else "str"


NamedOrOwnMap: TypeAlias = Annotated[
    Annotated[str, Tag("str")]
    | Annotated[MapSpec, Tag("dict[str, Any]")]
    | Annotated[TrackSpec, Tag("dict[str, track]")],
    Discriminator(_type_of_map),
]
"""A name, a file, or the map or track itself; errors are those of the one that is given."""
Amount: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]
"""An amount from nothing (0) to the greatest one (1)."""


class WeatherSpec(Spec):
    """The weather at the start, none by default; in a file also the name of a weather, such as heavy_rain."""

    clouds: Amount = 0.0
    fog: Amount = 0.0
    rain: Amount = 0.0
    snow: Amount = 0.0
    wind: Amount = 0.0
    """Slants rain and snow in images; no force on vehicles."""
    wetness: Amount | None = None
    """Wetness of the ground; left out: as after a long time of that rain, and it follows later changes."""
    snow_cover: Amount | None = None
    """Snow on the ground; left out: as after a long time of that snow, and it follows later changes."""

    @model_validator(mode="before")
    @classmethod
    def _by_name(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in PRESETS:
            amount = value.partition("=")[0].strip()
            also = f" Or an amount from 0 to 1: {amount}: 0.6 in a file, {amount}=0.6 in a command."
            also = also if amount in cls.model_fields else ""
            raise ValueError(f"the weather '{value}' is not known. {suggest(value, list(PRESETS))}{also}")
        return structs.asdict(PRESETS[value])

    @property
    def message(self) -> Weather:
        """The weather as a message."""
        return Weather(**self.model_dump())


class ScenarioSpec(Spec):
    """The start of a run; `autodrive.Scenario` is the same class.

    In Python: `Scenario(map="mini_map", vehicles={"V1": {"x": 0.5}, "V2": {}}, seed=3)`, for `autodrive.make`.
    """

    title: str = ""
    """Title shown in lists and on the page."""
    map: NamedOrOwnMap = "plane"
    """Name or file of a map or track, or the map or track itself."""
    vehicles: Annotated[dict[str, VehiclePlacement], Field(max_length=MAX_VEHICLES)] = Field(
        default_factory=lambda: {"V1": VehiclePlacement()}
    )
    """Vehicles by name. The devkit numbers them in this order: V1, V2, ..."""
    boxes: Annotated[dict[str, BoxSpec], Field(max_length=MAX_BOXES)] = Field(default_factory=dict)
    """Boxes by name."""
    removed_boxes: Annotated[tuple[str, ...], Field(max_length=MAX_BOXES)] = ()
    """Boxes of the map that are left out. One of that name in `boxes` takes its place."""
    scene_light: bool = True
    """True: day; False: night."""
    time_of_day: TimeOfDay | None = None
    """Time since midnight [s], or 'HH:MM', instead of `scene_light`; it stands still."""
    light_programs: Annotated[dict[str, LightProgramSpec | None], Field(max_length=MAX_PROGRAMS)] = Field(
        default_factory=dict
    )
    """Programs of traffic lights by name, in addition to those of the map; None: without that of the map."""
    traffic: TrafficSpec = TrafficSpec()
    """Cars that drive themselves; none by default."""
    weather: WeatherSpec = WeatherSpec()
    """Weather and ground at the start: amounts, or a name such as heavy_rain."""
    v2x: V2xSpec | None = None
    """Radio channel over which vehicles hear each other and traffic lights; left out: none."""
    tick: float = Field(default=0.01, ge=1e-5, le=0.1)
    """Simulated time between Frames [s]."""
    substep: float = Field(default=0.001, ge=SHORTEST_SUBSTEP, le=0.005)
    """Step of the physics [s]; a tick is a whole number of substeps."""
    gravity: float = Field(default=GRAVITY, ge=0, le=1e3)
    """[m/s^2]."""
    command_timeout: float = Field(default=0.5, ge=1e-5, le=1e9)
    """Time-out of a command [s of simulated time]; then the vehicle brakes and steers straight.

    A command expires with the first tick that begins this time or longer after it.
    """
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of all noise."""
    race: RaceSpec | None = None
    """The race whose laps are timed; left out: practice if the map is a race track, else none."""

    @model_validator(mode="after")
    def _whole_substeps(self) -> ScenarioSpec:
        tick, substep = exact_fraction(self.tick), exact_fraction(self.substep)
        is_whole = (tick / substep).denominator == 1
        if not is_whole or substep.denominator > FINEST:
            place = "tick" if "tick" in self.model_fields_set else "substep"
            text = f"tick {self.tick} s must be a whole number of substeps of {self.substep} s"
            if is_whole:
                text = f"substep {self.substep} s has more than 9 decimals, and is not the float of a simple fraction"
            raise RuleError([((place,), f"{text}; {_advice(tick, self.substep)}")])
        return self

    @model_validator(mode="after")
    def _not_too_many(self) -> ScenarioSpec:
        if (count := len({*self.vehicles, *self.traffic.names})) > MAX_VEHICLES:
            text = f"{count} vehicles, including the cars of the traffic; at most {MAX_VEHICLES} are possible"
            raise RuleError([(("traffic", "cars"), text)])
        return self

    @field_validator("vehicles")
    @classmethod
    def _not_empty(cls, vehicles: dict[str, Any]) -> dict[str, Any]:
        if not vehicles:
            raise ValueError("there must be at least one vehicle, such as 'V1: {type: nigel}'")
        return vehicles

    @field_validator("vehicles", "boxes")
    @classmethod
    def _plain_names(cls, named: dict[str, Any]) -> dict[str, Any]:
        for name in named:
            if not name.isidentifier() or len(name) > 100:
                raise ValueError(f"a name is letters, digits and '_', such as V1 or box_1, not '{name[:100]}'")
        return named

    @field_serializer("map")
    def _map_as_written(self, map_: str | MapSpec | TrackSpec, info: FieldSerializationInfo) -> Any:
        """The map without defaults, because some keys of a placement are allowed for some modules only."""
        return map_ if isinstance(map_, str) else map_.model_dump(mode=info.mode, exclude_unset=True)

    @property
    def map_name(self) -> str:
        """Name or file of the map, or the title of the scenario's own map."""
        return self.map if isinstance(self.map, str) else self.map.title or "track"

    @property
    def substeps(self) -> int:
        """Number of substeps in a tick."""
        return int(exact_fraction(self.tick) / exact_fraction(self.substep))

    @property
    def command_ticks(self) -> int:
        """Number of ticks in which a command acts that is not renewed."""
        return math.ceil(exact_fraction(self.command_timeout) / exact_fraction(self.tick))


def _advice(tick: Fraction, substep: float) -> str:
    """Names a substep that is not longer, and the tick, or one near it, that is a whole number of these substeps."""
    # 0.0333333 is meant as 1/30; a fraction of a large denominator may have no parts with exact floats
    for near in (tick.limit_denominator(10**6), tick.limit_denominator(10**4) or tick, Fraction(1, 100)):
        for part in whole_parts(near, longest=substep, shortest=SHORTEST_SUBSTEP):
            return f"set 'substep' to {part}" + ("" if near == tick else f" and 'tick' to {float(near)}")
    raise AssertionError("1e-5 s is a part of 0.01 s")


Scenario = ScenarioSpec
"""The short name of `ScenarioSpec` for users: `autodrive.Scenario`."""


def load_scenario(name: str | Path) -> ScenarioSpec:
    """Load a scenario by name or file. Raises `SpecError` with all errors."""
    from autodrive.scenario.kinds import find, read  # noqa: PLC0415  compiling needs no files

    return with_paths_of(read("scenario", name, ScenarioSpec), find("scenario", name).parent)


def with_paths_of(spec: ScenarioSpec, folder: Path) -> ScenarioSpec:
    """The scenario of a file in that folder, with absolute paths of the files that it names.

    Paths start at the folder; that of a map, vehicle, track or ruleset that is not there, at the working directory.
    """

    def there(kind: str, name: str) -> str:
        path = os.path.join(folder.absolute(), name)
        is_there = kind == "module" or (os.path.isfile(path) and path != os.path.abspath(name))
        return path if is_yaml(name) and is_there else name

    spec = with_files(spec, there)
    vehicles = {
        name: placement.model_copy(
            update={"own_sensors": {key: str(folder.absolute() / path) for key, path in placement.own_sensors.items()}}
        )
        for name, placement in spec.vehicles.items()
        if placement.own_sensors
    }
    return spec.model_copy(update={"vehicles": spec.vehicles | vehicles}) if vehicles else spec


def with_files(spec: ScenarioSpec, there: Callable[[str, str], str]) -> ScenarioSpec:
    """The scenario with other names of its files, given kind and name."""
    race = spec.race
    vehicles = {
        name: placement.model_copy(update={"type": there("vehicle", placement.type)})
        for name, placement in spec.vehicles.items()
    }
    if race is not None:
        names = {"rules": there("ruleset", race.rules), "track": race.track and there("track", race.track)}
        race = race.model_copy(update=names)
    traffic = spec.traffic
    if traffic.cars:
        traffic = traffic.model_copy(update={"type": there("vehicle", traffic.type)})
    map_ = spec.map
    if isinstance(map_, str):
        map_ = there("map", map_)
    elif isinstance(map_, MapSpec):
        map_ = with_modules(map_, lambda name: there("module", name))
    return spec.model_copy(update={"vehicles": vehicles, "race": race, "traffic": traffic, "map": map_})


def with_modules_at(map_: MapSpec, folder: Path) -> MapSpec:
    """The map with absolute paths of its modules, which are relative to that folder."""
    return with_modules(map_, lambda name: str(folder.absolute() / name) if is_yaml(name) else name)


def with_modules(map_: MapSpec, there: Callable[[str], str]) -> MapSpec:
    """The map with other names of its modules."""
    placements = tuple(
        placement.model_copy(update={"module": there(placement.module)}) for placement in map_.placements
    )
    return map_.model_copy(update={"placements": placements}) if placements else map_
