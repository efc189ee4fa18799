"""Compiles the Specs of a scenario into a Model, a State, an Engine and sensors, once before the first tick."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from autodrive.base.arrays import Integers
from autodrive.base.errors import EngineError, SensorError, SpecError
from autodrive.base.exact_fraction import exact_fraction
from autodrive.base.specs import PlaceInFile, Problem, SpecProblems
from autodrive.base.suggest import suggest
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.physics.buffers import Scratch, VehicleContacts, scratch, vehicle_contacts
from autodrive.physics.engine import Engine, Geom, Views
from autodrive.physics.model import Model, ShapeTable
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.own import OwnSensors, problem
from autodrive.physics.sensors.settings import ConfiguredSensor, configured_sensors
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.physics.state import State, empty_state
from autodrive.physics.weather import TARGETS
from autodrive.protocol.messages import Weather
from autodrive.scenario import MAX_BOXES, RaceSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.descriptions import Specs
from autodrive.scenario.maps.light_programs import all_programs, program_problems
from autodrive.scenario.maps.map import RESERVED, BoxPlacement, Map, compile_map, problem_texts, problems_of_draft
from autodrive.scenario.maps.mjcf import world_mjcf
from autodrive.scenario.maps.placing import PlacingProblem
from autodrive.scenario.maps.solids import fixed_shapes
from autodrive.scenario.scenario import SHORTEST_SUBSTEP
from autodrive.scenario.tracks import Track
from autodrive.scenario.vehicles.mjcf import vehicle_mjcf
from autodrive.scenario.vehicles.parameters import vehicle_table, wheel_table
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.scenario.vehicles.stability import greatest_damping, is_stable, longest_substep
from autodrive.world.placement import overlapping_boxes, overlapping_vehicles, placement_warnings, traffic_warnings
from autodrive.world.racing import Race
from autodrive.world.rules.traffic.start import with_traffic
from autodrive.world.rules.traffic.traffic import Fleet


@dataclass(frozen=True)
class CheckedScenario:
    """A scenario that was checked, as far as this is possible without an engine."""

    specs: Specs
    """The Specs that were checked."""
    spec: ScenarioSpec
    """The scenario, with the vehicles on the grid of its track."""
    map: Map
    vehicles: dict[str, VehicleSpec]
    """Spec of each vehicle by name, in the order of the rows of the Model."""
    configured: dict[str, dict[str, ConfiguredSensor]]
    """Sensors and cameras, also those that are off, by vehicle name and sensor name."""
    users_sensors: dict[tuple[str, str], Any]
    """The sensors of the user, by vehicle name and sensor name."""
    boxes: list[BoxPlacement]
    """Movable objects as they were placed."""
    map_problems: list[PlacingProblem]
    """What is wrong with a map that is being built, but can be simulated."""
    race: Race | None
    """The scorer of the race; None: the scenario has no race."""
    problems: list[Problem]
    """Why the scenario cannot be simulated."""
    warnings: list[Problem]
    """Probable mistakes that can be simulated."""

    @property
    def refusal(self) -> SpecProblems:
        """The error with all problems and warnings."""
        return SpecProblems([*self.problems, *(("warning: ", *warning) for warning in self.warnings)])


@dataclass(frozen=True)
class CompiledScenario(CheckedScenario):
    """All parts of a World."""

    targets: Integers
    """What each shape is for a LIDAR; see `SensorTables`."""
    sensors: SensorSuite
    own_sensors: OwnSensors
    cameras: dict[str, dict[str, CameraSpec]]
    """Cameras that are on, by vehicle name and camera name."""
    model: Model
    state: State
    engine: Engine
    views: Views
    contacts: VehicleContacts
    scratch: Scratch
    objects: dict[str, int]
    """Movable objects, in the order of `boxes`: name -> index of the pose in `State.qpos`."""
    fleet: Fleet
    """The traffic."""
    owners: list[str]
    """Name of the vehicle, box or fixed object of each solid (see `VehicleContacts`)."""

    @property
    def standing(self) -> dict[str, Callable[[float, float, float], tuple[float, ...]]]:
        """Function of each object and vehicle that gives its pose on the ground at x, y [m] with heading yaw [rad]."""
        vehicles = {name: vehicle.standing for name, vehicle in self.vehicles.items()}
        return {box.name: box.standing for box in self.boxes} | vehicles


def compile_specs(specs: Specs) -> CompiledScenario:
    """Compiles a scenario. Raises `SpecProblems` with all problems."""
    checked = _checked(specs)
    fixed = fixed_shapes(checked.map.statics)
    return _compiled(checked, _engine(checked, fixed), fixed)


def _checked(specs: Specs) -> CheckedScenario:
    """The scenario with all problems that are known without an engine. Raises `SpecProblems` if it cannot have one."""
    map_, vehicles, problems, map_problems = _load(specs)
    if map_ is None:
        raise SpecProblems(problems)
    spec = on_grid(specs.scenario, map_)
    if spec.traffic.cars:
        spec, wrong_traffic = _add_traffic(specs, spec, map_, vehicles)
        problems += wrong_traffic
    configured, wrong_sensors = _configured(spec, vehicles)
    own_sensors, wrong_own_sensors = _own_sensors(specs, spec, configured)
    boxes, unknown_boxes = _boxes(spec, map_)
    race, wrong_race = _race(specs, map_, [box.name for box in boxes])
    twice = _names_used_twice(spec, map_, boxes)
    problems += [
        (_at("light_programs", name), f": {text}")
        for name, text in program_problems(all_programs(map_.light_programs, spec.light_programs), map_.traffic_lights)
        if name in spec.light_programs
    ]
    problems = [*overlapping_boxes(spec, map_, boxes), *problems, *wrong_sensors, *wrong_own_sensors]
    problems += [*unknown_boxes, *wrong_race, *twice]
    warnings = placement_warnings(spec, map_, vehicles, boxes) + traffic_warnings(spec, vehicles)
    warnings += [(_at("map"), ": ", *fault.text) for fault in map_problems]
    if len(boxes) > MAX_BOXES:
        text = f": {len(boxes)} boxes with those of the map; at most {MAX_BOXES} are possible"
        problems.append((_at("boxes"), text))
    checked = CheckedScenario(
        specs, spec, map_, vehicles, configured, own_sensors, boxes, map_problems, race, problems, warnings
    )
    if twice or len(boxes) > MAX_BOXES or not vehicles:  # without an engine, overlaps are not known
        raise checked.refusal
    return checked


def _engine(checked: CheckedScenario, fixed: ShapeTable) -> Engine:
    """The engine with all bodies at their starts. Raises `SpecProblems` if there are problems, also of these bodies."""
    spec = checked.spec
    placements = [(name, vehicle, spec.vehicles[name]) for name, vehicle in checked.vehicles.items()]
    bodies = [vehicle_mjcf(name, vehicle, place.x, place.y, place.yaw) for name, vehicle, place in placements]
    try:
        engine = Engine(world_mjcf(checked.map, checked.boxes, bodies, spec.substep, spec.gravity), fixed)
    except EngineError as error:
        place = _at("boxes" if spec.boxes else "vehicles")
        checked.problems.append((place, f": {error}. Check whether many bodies are at the same place."))
        raise checked.refusal from None
    owners = _owners(checked.map, engine.geoms())
    checked.problems.extend(
        overlapping_vehicles(checked.vehicles, [(owners[a], owners[b]) for a, b in engine.overlapping()])
    )
    checked.problems.extend(_unstable_vehicles(checked.vehicles, spec))
    if checked.problems:
        raise checked.refusal
    return engine


def _compiled(checked: CheckedScenario, engine: Engine, fixed: ShapeTable) -> CompiledScenario:
    """All parts of a World. Raises `SpecProblems` for a sensor of the user that fails."""
    spec, vehicles, configured, geoms = checked.spec, checked.vehicles, checked.configured, engine.geoms()
    owners = _owners(checked.map, geoms)
    shapes = _with_movable(fixed, geoms, {engine.body(name)[0]: i for i, name in enumerate(vehicles)})
    grips = grip_factors(spec, vehicles)
    model = Model(
        dt=spec.substep,
        gravity=spec.gravity,
        vehicles=vehicle_table(vehicles, engine, geoms, spec.substep),
        wheels=wheel_table([*vehicles.values()], grips, spec.substep, checked.map.ground, Weather()),
        shapes=shapes,
    )
    targets = _targets(checked.map, checked.boxes, owners[1:], shapes)  # without the floor
    state = empty_state(model, engine.body_count)
    objects = {box.name: engine.body(box.name)[1] for box in checked.boxes}
    poses = {name: engine.body(name)[1] for name in vehicles} | objects
    times = {"substep": exact_fraction(spec.substep), "substeps": spec.substeps}
    own = OwnSensors({name: [*sensors] for name, sensors in configured.items()}, poses, shapes, state, **times)
    for (vehicle, name), sensor in checked.users_sensors.items():
        try:
            own.add(vehicle, name, sensor)
        except SensorError as error:
            raise SpecProblems([(_at("vehicles", vehicle, "own_sensors", name), f": {error}")]) from None
    return CompiledScenario(
        **vars(checked),
        targets=targets,
        sensors=SensorSuite(configured, shapes, state, targets, gravity=spec.gravity, **times),
        own_sensors=own,
        cameras=_cameras(configured),
        model=model,
        state=state,
        engine=engine,
        views=engine.views(),
        contacts=vehicle_contacts(model),
        scratch=scratch(model, engine.body_count),
        objects=objects,
        fleet=Fleet(spec, checked.map, vehicles, [(objects[box.name], box.size) for box in checked.boxes]),
        owners=owners,
    )


def grip_factors(spec: ScenarioSpec, vehicles: Mapping[str, VehicleSpec]) -> list[float]:
    """Factor of the friction of each vehicle of a scenario, on the floor that its placement names."""
    placed = spec.vehicles
    return [placed[name].grip_factor * vehicle.grip_on(placed[name].surface) for name, vehicle in vehicles.items()]


def _owners(map_: Map, geoms: Sequence[Geom]) -> list[str]:
    """Name of the vehicle, box or fixed object of each solid; the first one is the floor."""
    names = ["ground", *(shape.name for shape in map_.statics), *(geom.name for geom in geoms)]
    return [name.split("/")[0] for name in names]


def _race(specs: Specs, map_: Map, boxes: Collection[str]) -> tuple[Race | None, list[Problem]]:
    """The race of a scenario, and problems. On a race track laps are always timed."""
    spec = specs.scenario
    race = spec.race or RaceSpec()
    try:
        track = Track.of(specs.track.spec, specs.track.name) if specs.track else map_.track
        if track is None:
            return None, [(_at("race"), f": map '{spec.map_name}' is not a track; set 'track'")] if spec.race else []
        assert specs.rules is not None
        rules = specs.rules.spec
        if race.laps is not None:
            rules = rules.model_copy(update={"race_laps": race.laps})
        return Race([*spec.vehicles], track, rules, spec.tick, boxes), []
    except SpecError as error:
        return None, [(_at("race"), f": {text}") for text in error.errors]


def _with_movable(fixed: ShapeTable, geoms: Sequence[Geom], body_vehicle: Mapping[int, int]) -> ShapeTable:
    """The fixed shapes, then those of the movable bodies. `body_vehicle`: numbers of the vehicles, by their bodies."""
    movable = {
        "kind": np.array([geom.kind for geom in geoms], dtype=np.int64),
        "size": np.array([geom.size for geom in geoms], dtype=np.float64),
        "bounding_radius": np.array([geom.bounding_radius for geom in geoms], dtype=np.float64),
        "position": np.array([geom.position for geom in geoms], dtype=np.float64),
        "rotation": np.array([rotation_from_quaternion(geom.orientation) for geom in geoms], dtype=np.float64),
        "vehicle": np.array([body_vehicle.get(geom.body, -1) for geom in geoms], dtype=np.int64),
        "dof": np.array([geom.dof for geom in geoms], dtype=np.int64),
        "qpos": np.array([geom.qpos for geom in geoms], dtype=np.int64),
    }
    return fixed._replace(**{name: np.concatenate([getattr(fixed, name), column]) for name, column in movable.items()})


def _targets(map_: Map, boxes: Sequence[BoxPlacement], owners: Sequence[str], shapes: ShapeTable) -> Integers:
    """What each shape is for a LIDAR: numbers of `weather.TARGETS`."""
    kinds = {shape.name.split("/")[0]: shape.material for shape in map_.statics} | {box.name: "box" for box in boxes}
    names = ["vehicle" if v >= 0 else kinds[owner] for owner, v in zip(owners, shapes.vehicle.tolist(), strict=True)]
    return np.array([TARGETS[name] for name in names], np.int64)


def on_grid(spec: ScenarioSpec, map_: Map) -> ScenarioSpec:
    """Place vehicles without a pose on the grid behind the start line, if the map is a race track."""
    if map_.track is None:
        return spec
    count = len(spec.vehicles)
    placed: dict[str, VehiclePlacement] = {}
    for place, (name, placement) in enumerate(spec.vehicles.items()):
        x, y, yaw = map_.track.grid_pose(place, count)
        pose = {"x": round(x, 4), "y": round(y, 4), "yaw_deg": round(math.degrees(yaw), 4)}
        has_pose = bool(placement.model_fields_set & {*pose})
        placed[name] = placement if has_pose else placement.model_copy(update=pose)
    return spec.model_copy(update={"vehicles": placed})


def _at(*location: str | int) -> PlaceInFile:
    """A value of the scenario."""
    return PlaceInFile("scenario", location)


def _load(specs: Specs) -> tuple[Map | None, dict[str, VehicleSpec], list[Problem], list[PlacingProblem]]:
    """The map without its faulty placements, the valid vehicles, the problems of all files, and those of a draft."""
    map_, map_problems = compile_map(specs.map)
    is_file = isinstance(specs.scenario.map, str)
    path = f"  ({specs.map.path})" if is_file and specs.map.path else ""
    texts = problem_texts(specs.map, map_problems, has_name=is_file)
    problems: list[Problem] = [(_at("map"), ": ", *text, path) for text in texts]
    vehicles: dict[str, VehicleSpec] = {}
    for name, placement in specs.scenario.vehicles.items():
        try:
            vehicle = specs.vehicles[placement.type].spec
            vehicles[name] = placed_vehicle(vehicle, placement)
            if placement.surface not in (None, *vehicle.wheels.surfaces):
                known = suggest(str(placement.surface), [*vehicle.wheels.surfaces])
                text = f": '{placement.surface}' is no floor of 'wheels.surfaces' of '{placement.type}'. {known}"
                problems.append((_at("vehicles", name, "surface"), text))
        except SpecError as error:
            path = f"  ({error.path})" if error.path else ""
            problems += [(_at("vehicles", name, "type"), f": {text}{path}") for text in error.errors]
    return map_, vehicles, problems, problems_of_draft(specs.map, map_problems)


def placed_vehicle(vehicle: VehicleSpec, placement: VehiclePlacement) -> VehicleSpec:
    """A vehicle with the factors of its placement."""
    return vehicle.with_factors(placement.mass_factor, placement.drive_factor, placement.steering_trim)


def _add_traffic(
    specs: Specs, spec: ScenarioSpec, map_: Map, vehicles: dict[str, VehicleSpec]
) -> tuple[ScenarioSpec, list[Problem]]:
    """The scenario with the vehicles of its traffic, which are added to `vehicles`, and problems."""
    try:
        vehicle = specs.vehicles[spec.traffic.type].spec
    except SpecError as error:
        path = f"  ({error.path})" if error.path else ""
        return spec, [(_at("traffic", "type"), f": {text}{path}") for text in error.errors]
    for name in spec.traffic.names:
        vehicles.pop(name, None)
    spec, problems = with_traffic(spec, map_, vehicle)
    vehicles |= dict.fromkeys([] if problems else spec.traffic.names, vehicle)
    return spec, problems


def _unstable_vehicles(vehicles: dict[str, VehicleSpec], spec: ScenarioSpec) -> list[Problem]:
    """A problem for each vehicle whose springs and dampers are not stable with the substep of the scenario."""
    return [
        (
            _at("vehicles", name),
            f": the springs and dampers of '{spec.vehicles[name].type}' are unstable with a "
            f"substep of {spec.substep:g} s; {_stable(vehicle, spec)}",
        )
        for name, vehicle in vehicles.items()
        if not is_stable(vehicle, spec.substep)
    ]


def _stable(vehicle: VehicleSpec, spec: ScenarioSpec) -> str:
    """The advice that makes a vehicle stable."""
    if substep := longest_substep(vehicle, spec.tick, longest=spec.substep, shortest=SHORTEST_SUBSTEP):
        return f"set 'substep' to at most {substep}"
    if damping := greatest_damping(vehicle, spec.substep):
        return f"no substep of a scenario is short enough; set 'wheels.suspension.damping' to at most {damping:g}"
    return "no substep of a scenario is short enough; its springs are too stiff for its mass and inertia"


def _boxes(spec: ScenarioSpec, map_: Map) -> tuple[list[BoxPlacement], list[Problem]]:
    """The boxes of the map, then those of the scenario, which may replace a box of the map; and problems."""
    of_map = {box.name: box for box in map_.boxes}
    problems: list[Problem] = [
        (_at("removed_boxes"), f": the map has no box '{name}'. {suggest(name, list(of_map))}")
        for name in spec.removed_boxes
        if name not in of_map
    ]
    placed = {
        name: BoxPlacement(
            name=name,
            size=box.size,
            mass=box.mass,
            position=(box.x, box.y, box.size[2] / 2 if box.z is None else box.z),
            yaw=math.radians(box.yaw_deg),
        )
        for name, box in spec.boxes.items()
    }
    removed = set(spec.removed_boxes)
    kept = [
        placed[name] if name in removed else box
        for name, box in of_map.items()
        if name in placed or name not in removed
    ]
    return [*kept, *(box for name, box in placed.items() if name not in removed)], problems


def _names_used_twice(spec: ScenarioSpec, map_: Map, boxes: list[BoxPlacement]) -> list[Problem]:
    names = Counter([*spec.vehicles, *(box.name for box in boxes), *(shape.name for shape in map_.statics), *RESERVED])
    return [
        (
            _at("boxes" if name in spec.boxes else "vehicles", name),
            f": the name '{name}' is used twice; vehicles, boxes and fixed objects need different names, and none of "
            f"them may be {' or '.join(RESERVED)}",
        )
        for name in sorted({*spec.vehicles, *spec.boxes})
        if names[name] > 1
    ]


def sensors_of(vehicle: VehicleSpec, placement: VehiclePlacement) -> dict[str, ConfiguredSensor]:
    """The sensors and cameras of a vehicle in a scenario, by name. Raises `SpecError`."""
    return configured_sensors(
        vehicle.sensors,
        vehicle.cameras,
        placement.sensors,
        is_realistic=placement.has_realistic_sensors,
        noise_factor=placement.noise_factor,
    )


def _configured(
    spec: ScenarioSpec, vehicles: dict[str, VehicleSpec]
) -> tuple[dict[str, dict[str, ConfiguredSensor]], list[Problem]]:
    """The sensors and cameras of all vehicles, and problems."""
    problems: list[Problem] = []
    configured: dict[str, dict[str, ConfiguredSensor]] = {}
    for name, vehicle in vehicles.items():
        try:
            configured[name] = sensors_of(vehicle, spec.vehicles[name])
        except SpecError as error:
            problems += [(f"vehicles.{name}.sensors.{text}",) for text in error.errors]
    return configured, problems


def _own_sensors(
    specs: Specs, spec: ScenarioSpec, configured: Mapping[str, Mapping[str, object]]
) -> tuple[dict[tuple[str, str], Any], list[Problem]]:
    """The sensors of the user by vehicle and name, and problems."""
    problems: list[Problem] = []
    sensors: dict[tuple[str, str], Any] = {}
    for vehicle, known in configured.items():
        for name, reference in spec.vehicles[vehicle].own_sensors.items():
            kind = specs.own_sensors[reference]
            try:
                if not isinstance(kind, str):
                    sensors[vehicle, name] = kind()
                wrong = kind if isinstance(kind, str) else problem(name, sensors[vehicle, name], [*known])
            except Exception as error:
                wrong = f"'{reference}' cannot be loaded: {type(error).__name__}: {error}"
            if wrong:
                problems.append((_at("vehicles", vehicle, "own_sensors", name), f": {wrong}"))
    return sensors, problems


def _cameras(configured: dict[str, dict[str, ConfiguredSensor]]) -> dict[str, dict[str, CameraSpec]]:
    return {
        name: {
            camera: sensor.spec
            for camera, sensor in sensors.items()
            if isinstance(sensor.spec, CameraSpec) and sensor.is_on
        }
        for name, sensors in configured.items()
    }
