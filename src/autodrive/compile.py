"""A ScenarioSpec becomes a Model, a State, an Engine and sensors: once a scenario, before its first tick."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from autodrive.errors import SpecError
from autodrive.maps.map import BoxPlacement, Map, load_map
from autodrive.maps.mjcf import world_mjcf
from autodrive.model import VEHICLE, WHEEL, Model, Shapes, Table
from autodrive.physics.engine import Engine, Views
from autodrive.physics.tick import GROUND_COLUMNS, Scratch, Touches
from autodrive.scenario import ScenarioSpec
from autodrive.sensors.camera import CameraSpec
from autodrive.sensors.catalog import SensorSuite
from autodrive.state import Floats, State
from autodrive.vehicles.mjcf import vehicle_mjcf
from autodrive.vehicles.spec import VehicleSpec, load_vehicle


@dataclass(frozen=True)
class Compiled:
    """What a World runs on."""

    spec: ScenarioSpec
    map: Map
    vehicles: dict[str, VehicleSpec]
    """In the order of the Model's rows."""
    sensors: dict[str, SensorSuite]
    """By vehicle."""
    cameras: dict[str, dict[str, CameraSpec]]
    """By vehicle, by name."""
    model: Model
    state: State
    engine: Engine
    views: Views
    touches: Touches
    scratch: Scratch
    objects: dict[str, int]
    """Movable things: name -> where their pose begins in the engine's qpos."""
    boxes: list[BoxPlacement]
    """The same things, in the same order, as they were placed."""
    owners: list[str]
    """Name of the thing that each of the engine's geoms is part of."""


def compile_scenario(spec: ScenarioSpec) -> Compiled:
    """Loads all that the scenario names. Raises `SpecError` with all faults."""
    map_, vehicles = _load(spec)
    boxes = _boxes(spec, map_)
    _check_names(spec, map_, boxes)
    bodies = [
        vehicle_mjcf(name, vehicle, spec.vehicles[name].x, spec.vehicles[name].y, spec.vehicles[name].yaw)
        for name, vehicle in vehicles.items()
    ]
    engine = Engine(world_mjcf(map_, boxes, bodies, spec.substep, spec.gravity))
    _check_places(vehicles, engine)
    geoms = engine.geoms()
    body_vehicle = {engine.body(name)[0]: i for i, name in enumerate(vehicles)}
    shapes = Shapes(
        kind=np.array([geom.kind for geom in geoms], dtype=np.int64),
        size=np.array([geom.size for geom in geoms], dtype=np.float64).reshape(-1, 3),
        bounding_radius=np.array([geom.bounding_radius for geom in geoms], dtype=np.float64),
        vehicle=np.array([body_vehicle.get(geom.body, -1) for geom in geoms], dtype=np.int64),
        dof=np.array([geom.dof for geom in geoms], dtype=np.int64),
        qpos=np.array([geom.qpos for geom in geoms], dtype=np.int64),
    )
    model = Model(
        dt=spec.substep,
        gravity=spec.gravity,
        vehicles=_vehicle_table(vehicles, engine, spec.substep),
        wheels=_wheel_table(vehicles, map_.ground.grip, spec.substep),
        shapes=shapes,
    )
    n, n_geom = len(vehicles), len(engine.geom_bodies)
    geom_vehicle = np.array([body_vehicle.get(body, -1) for body in engine.geom_bodies], dtype=np.int64)
    return Compiled(
        spec=spec,
        map=map_,
        vehicles=vehicles,
        sensors=_sensors(spec, vehicles),
        cameras=_cameras(spec, vehicles),
        model=model,
        state=empty_state(model),
        engine=engine,
        views=engine.views(np.array([geom.number for geom in geoms], dtype=np.int64)),
        touches=Touches(
            geom_vehicle=geom_vehicle,
            impulse=np.zeros((n, n_geom)),
            position=np.zeros((n, n_geom, 3)),
            pairs=np.zeros((64, 2), dtype=np.int64),
            pair_count=np.zeros(1, dtype=np.int64),
        ),
        scratch=Scratch(
            nearby=np.zeros((n, len(geoms)), dtype=np.int64),
            nearby_count=np.zeros(n, dtype=np.int64),
            velocity=np.zeros((n, 3)),
            ground=np.zeros((4, GROUND_COLUMNS)),
            contact_force=np.zeros(6),
            contact_position=np.zeros(3),
            contact_geoms=np.zeros(2, dtype=np.int32),
        ),
        objects={box.name: engine.body(box.name)[1] for box in boxes},
        boxes=boxes,
        owners=_owners(engine),
    )


def empty_state(model: Model) -> State:
    """All zero, of the right shapes."""
    n, n_shape = len(model.vehicles), len(model.shapes.kind)
    queue = 1 + int(max(model.vehicles["drive_delay"].max(initial=0), model.vehicles["steering_delay"].max(initial=0)))
    widths: dict[str, tuple[int, ...]] = {
        **{f"vehicle_{name}": (n, 3) for name in ("position", "velocity", "angular_velocity", "acceleration")},
        "vehicle_angular_acceleration": (n, 3),
        "vehicle_orientation": (n, 4),
        **dict.fromkeys(("throttle", "drive_level", "steering_target", "steering_angle"), (n,)),
        "throttle_queue": (n, queue),
        "steering_queue": (n, queue),
        "wheel_force": (4 * n, 2),
        "wheel_hold": (4 * n, 2),
        "shape_position": (n_shape, 3),
        "shape_rotation": (n_shape, 9),
    }
    return State(**{name: np.zeros(widths.get(name, (4 * n,))) for name in State._fields})


def _load(spec: ScenarioSpec) -> tuple[Map, dict[str, VehicleSpec]]:
    """The map and the vehicles that the scenario names; the faults of all of them are told at once."""
    faults: list[str] = []

    def told(place: str, error: SpecError) -> None:
        faults.extend(f"{place}: {fault}" + (f"  ({error.path})" if error.path else "") for fault in error.faults)

    map_: Map | None = None
    vehicles: dict[str, VehicleSpec] = {}
    try:
        map_ = load_map(spec.map)
    except SpecError as error:
        told("map", error)
    for name, placement in spec.vehicles.items():
        try:
            vehicles[name] = load_vehicle(placement.type)
        except SpecError as error:
            told(f"vehicles.{name}.type", error)
    if map_ is None or faults:
        raise SpecError(faults)
    return map_, vehicles


def _owners(engine: Engine) -> list[str]:
    """Name of the thing that each geom is part of."""
    return [name.split("/")[0] for name in engine.geom_names]


def _check_places(vehicles: dict[str, VehicleSpec], engine: Engine) -> None:
    """No vehicle may begin inside another thing."""
    owners = _owners(engine)
    pairs = {tuple(sorted((owners[a], owners[b]))) for a, b in engine.overlapping()}
    faults = [
        f"'{a}' and '{b}' stand in each other at the start; move one of them"
        for a, b in sorted(pairs)
        if {a, b} & set(vehicles)
    ]
    if faults:
        raise SpecError(faults)


def _boxes(spec: ScenarioSpec, map_: Map) -> list[BoxPlacement]:
    own = [
        BoxPlacement(
            name=name,
            size=box.size,
            mass=box.mass,
            position=(box.x, box.y, box.size[2] / 2 if box.z is None else box.z),
            yaw=math.radians(box.yaw_deg),
        )
        for name, box in spec.boxes.items()
    ]
    return [*map_.boxes, *own]


def _check_names(spec: ScenarioSpec, map_: Map, boxes: list[BoxPlacement]) -> None:
    names = [*spec.vehicles, *(box.name for box in boxes), *(shape.name for shape in map_.statics), "ground"]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SpecError(
            [f"the name '{name}' is given twice; vehicles, boxes and fixed things share names" for name in twice]
        )


def _sensors(spec: ScenarioSpec, vehicles: dict[str, VehicleSpec]) -> dict[str, SensorSuite]:
    substep = Fraction(str(spec.substep))
    suites = {
        name: vehicle.sensors.realistic() if spec.vehicles[name].has_realistic_sensors else vehicle.sensors
        for name, vehicle in vehicles.items()
    }
    return {
        name: SensorSuite(suite, vehicle=i, name=name, substep=substep, gravity=spec.gravity)
        for i, (name, suite) in enumerate(suites.items())
    }


def _cameras(spec: ScenarioSpec, vehicles: dict[str, VehicleSpec]) -> dict[str, dict[str, CameraSpec]]:
    return {
        name: {
            camera: its.realistic() if spec.vehicles[name].has_realistic_sensors else its
            for camera, its in vehicle.cameras.items()
        }
        for name, vehicle in vehicles.items()
    }


def _vehicle_table(vehicles: dict[str, VehicleSpec], engine: Engine, dt: float) -> Table:
    table = np.zeros(len(vehicles), dtype=VEHICLE)
    for row, (name, spec) in zip(table, vehicles.items(), strict=True):
        _, row["qpos"], row["dof"] = engine.body(name)
        for field in ("mass", "inertia", "center_of_mass", "drag", "angular_drag", "angular_velocity_max"):
            row[field] = getattr(spec.body, field)
        row["wheelbase"] = spec.wheelbase
        row["steering_limit"] = spec.steering.limit
        row["steering_rate_limit"] = spec.steering.rate_limit
        row["steering_response"] = _response(spec.steering.time_constant, dt)
        row["steering_delay"] = round(spec.steering.dead_time / dt)
        row["drive_is_speed_controlled"] = spec.drivetrain.control == "speed"
        row["drive_speed_limit"] = spec.drivetrain.speed_limit
        row["drive_torque_limit"] = spec.drivetrain.torque_limit
        row["drive_servo_gain"] = spec.drivetrain.servo_gain
        row["drive_response"] = _response(spec.drivetrain.time_constant, dt)
        row["drive_delay"] = round(spec.drivetrain.dead_time / dt)
        row["brake_torque"] = spec.drivetrain.brake_torque
    return table


def _wheel_table(vehicles: dict[str, VehicleSpec], grip: float, dt: float) -> Table:
    table = np.zeros(4 * len(vehicles), dtype=WHEEL)
    for i, spec in enumerate(vehicles.values()):
        wheel, regular = spec.wheels, spec.wheels.regularisation
        rows = table[4 * i : 4 * i + 4]
        rows["hub"] = spec.hubs
        rows["is_steered"] = True, True, False, False
        rows["is_driven"] = False, False, True, True
        rows["sprung_mass"] = sprung_masses(spec)
        rows["effective_mass"] = effective_masses(spec)
        rows["inertia"] = 0.5 * wheel.mass * wheel.radius**2
        rows["radius"], rows["damping_rate"], rows["force_height"] = (
            wheel.radius,
            wheel.damping_rate,
            wheel.force_height,
        )
        suspension = wheel.suspension
        for field in ("stiffness", "damping", "compression_max", "droop_max", "bump_stiffness"):
            rows[field] = getattr(suspension, field)
        rows["look_ahead"] = suspension.look_ahead(dt)
        factor = (1.0, grip, 1.0, grip, 1.0)
        rows["forward"] = np.multiply(wheel.forward_friction.numbers, factor)
        rows["sideways"] = np.multiply(wheel.sideways_friction.numbers, factor)
        for field in ("active_slip_offset", "passive_slip_minimum", "slip_angle_offset", "hold_speed"):
            rows[field] = getattr(regular, field)
        # a quarter of the car on each spring; no stiffer than the substep can follow, damped at 0.7 of critical
        frequency = 2.0 * math.pi * min(regular.hold_frequency, 0.04 / dt)
        rows["hold_stiffness"] = spec.body.mass / 4 * frequency**2
        rows["hold_damping"] = 2.0 * 0.7 * spec.body.mass / 4 * frequency
    return table


def _response(time_constant: float, dt: float) -> float:
    """Share of the way to its target that a first-order lag goes in one step."""
    return 1.0 - math.exp(-dt / time_constant) if time_constant > 0.0 else 1.0


def sprung_masses(spec: VehicleSpec) -> Floats:
    """Mass on each wheel's spring [kg], shape (4,).

    They sum to the car's, balance about its centre of mass, and differ as little as can be (PhysX,
    PxVehicleComputeSprungMasses).
    """
    hubs = np.array(spec.hubs)
    x, y, _ = spec.body.center_of_mass
    balance = np.stack([np.ones(4), hubs[:, 0], hubs[:, 1]])
    return np.asarray(np.linalg.lstsq(balance, spec.body.mass * np.array([1.0, x, y]), rcond=None)[0], np.float64)


def effective_masses(spec: VehicleSpec) -> Floats:
    """Least mass that a horizontal force at each contact point meets [kg], shape (4,), shared by four wheels.

    1 / (1/m + (r x d) . I^-1 (r x d)) for a unit force d at r from the centre of mass (Featherstone (2.74)).
    """
    r = np.array(spec.hubs) - [0.0, 0.0, spec.wheels.radius] - np.array(spec.body.center_of_mass)
    inverse = [
        1.0 / spec.body.mass + np.sum(np.cross(r, d) ** 2 / np.array(spec.body.inertia), axis=1)
        for d in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    ]
    return 0.25 / np.max(inverse, axis=0)
