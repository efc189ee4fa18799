"""The stages of a fit: steering map, speed or force, then tyres and all together, for each kind of drivetrain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from autodrive.experiments.identification.parameters import Free, VehicleFile
from autodrive.experiments.identification.starts import Starts
from autodrive.scenario.vehicles.spec import VehicleSpec

SLOW = 1.3
"""Speed up to which the angle of the wheels follows from the circle with little influence of the tyres [m/s]."""
GENTLE = 2.0
"""Lateral acceleration up to which that holds [m/s^2]."""
LEAST_STARTS = 20
"""Number of slow and gentle starts below which the first stage uses all of them."""
KNOTS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Commands at which a vehicle without a curve of its steering gets one."""
TIRED = 0.05
"""Deviation of the prior of a value that drives usually do not show, as a share of its range."""


@dataclass(frozen=True)
class FitStage:
    """A stage of the fit: the parameters that it adds to those of the stages before, and the starts that it uses."""

    title: str
    paths: tuple[str, ...]
    is_slow: bool = False
    """Whether only slow and gentle starts are used."""
    is_alone: bool = False
    """Whether only its own parameters move; otherwise those of the stages before, too."""


@dataclass(frozen=True)
class FitPlan:
    """Stages, bounds and priors for a vehicle."""

    values: dict[str, object]
    """What the vehicle's file gets before the fit, such as a curve of the steering."""
    bounds: dict[str, tuple[float, float]]
    """Bounds of the parameters, by path."""
    priors: dict[str, float]
    """Deviations of the priors around the start, as shares of the range."""
    stages: tuple[FitStage, ...]
    session: tuple[str, ...]
    """Values of the drives that are fitted beside those of the vehicle."""

    def start(self, file: VehicleFile, path: str) -> float:
        """Where the fit of a parameter starts: the value of the file, within the bounds."""
        return self.free(file, [path])[0].start

    def free(self, file: VehicleFile, paths: Sequence[str]) -> list[Free]:
        """The parameters with these paths. Raises `IdentificationError`."""
        return file.free({path: self.bounds[path] for path in paths})


def plan_for(spec: VehicleSpec) -> FitPlan:
    """The stages for a vehicle: those of its kind of drivetrain."""
    bounds: dict[str, tuple[float, float]] = {}
    priors: dict[str, float] = {}
    values: dict[str, object] = {}
    curve = [[float(command), float(angle)] for command, angle in spec.steering.curve]
    if not curve:
        curve = [[knot, knot * spec.steering.limit_deg] for knot in KNOTS]
        values["steering.curve"] = curve
    largest = max(abs(angle) for _, angle in curve)
    for i, (command, angle) in enumerate(curve):
        if command != 0.0:  # the angle at 0 is the offset
            room = 0.35 * abs(angle) + 0.1 * largest
            # between the neighbours as they are, because the angles must not fall
            below = curve[i - 1][1] if i > 0 else -59.0
            above = curve[i + 1][1] if i + 1 < len(curve) else 59.0
            bounds[f"steering.curve.{i}.1"] = (max(below, angle - room), min(above, angle + room))
            priors[f"steering.curve.{i}.1"] = 0.5
    steering = [*bounds, "steering.offset_deg", "steering.dead_time"]
    bounds["steering.offset_deg"] = (-4.0, 4.0)
    bounds["steering.dead_time"] = (0.0, 0.25)
    priors["steering.dead_time"] = 0.15
    if spec.steering.rate_limit is not None:
        bounds["steering.rate_limit"] = (0.3 * spec.steering.rate_limit, 3.0 * spec.steering.rate_limit)
        priors["steering.rate_limit"] = 0.2
        steering.append("steering.rate_limit")
    right, left = spec.steering.command_limits
    for i, limit in enumerate((right, left)):
        if abs(limit) < 1.0:
            bounds[f"steering.command_limits.{i}"] = (0.3, 1.0) if limit > 0.0 else (-1.0, -0.3)
            steering.append(f"steering.command_limits.{i}")
    drive = _drive(spec, bounds, priors)
    tyres = _tyres(spec, bounds, priors)
    return FitPlan(
        values,
        bounds,
        priors,
        (
            FitStage("steering at low speed", tuple(steering), is_slow=True, is_alone=True),
            FitStage("speed and force", tuple(drive), is_alone=True),
            FitStage("tyres", tuple(tyres)),
        ),
        ("trim",) if spec.drivetrain.control == "speed" else ("trim", "drive"),
    )


def _drive(spec: VehicleSpec, bounds: dict[str, tuple[float, float]], priors: dict[str, float]) -> list[str]:
    """Paths of what sets the speed."""
    paths: list[str] = []

    def add(path: str, low: float, high: float, prior: float | None = None) -> None:
        bounds[path] = (low, high)
        paths.append(path)
        if prior is not None:
            priors[path] = prior

    drivetrain = spec.drivetrain
    if drivetrain.control == "speed":
        rpm = drivetrain.speed_limit_rpm
        add("drivetrain.speed_gain", 0.6, 1.4)
        add("drivetrain.speed_offset_rpm", -0.05 * rpm, 0.05 * rpm)
        add("drivetrain.time_constant", 0.0, 0.3, 0.1)
        add("drivetrain.dead_time", 0.0, 0.25, 0.1)
        if drivetrain.rate_limit is not None:
            add("drivetrain.rate_limit", 0.2 * drivetrain.rate_limit, 5.0 * drivetrain.rate_limit, 0.2)
        return paths
    add("drivetrain.torque_limit", 0.2 * drivetrain.torque_limit, 5.0 * drivetrain.torque_limit)
    if drivetrain.control == "voltage":
        add("drivetrain.speed_limit_rpm", 0.3 * drivetrain.speed_limit_rpm, 3.0 * drivetrain.speed_limit_rpm, 0.3)
    curve = drivetrain.throttle_curve
    for i, (throttle, share) in enumerate(curve):
        if share == 0.0 and throttle > 0.0:
            following = curve[i + 1][0] if i + 1 < len(curve) else 1.0
            add(f"drivetrain.throttle_curve.{i}.0", 0.3 * throttle, min(0.95 * following, 2.0 * throttle), 0.2)
        elif 0.0 < share < 1.0:
            add(f"drivetrain.throttle_curve.{i}.1", 0.3 * share, min(1.0, 2.5 * share), 0.3)
    add("wheels.rolling_resistance", 0.0, 0.4, 0.3)
    add("wheels.steering_resistance", 0.0, 1.0, 0.3)
    add("body.drag", 0.0, 1.5, 0.3)
    return paths


def _tyres(spec: VehicleSpec, bounds: dict[str, tuple[float, float]], priors: dict[str, float]) -> list[str]:
    """Paths of the tyres."""
    magic = spec.wheels.magic_formula
    if magic is None:
        bounds["wheels.sideways_friction.stiffness"] = (0.2, 3.0)
        return ["wheels.sideways_friction.stiffness"]
    paths = []
    for axle in ("front", "rear"):
        path = f"wheels.magic_formula.{axle}_cornering_stiffness"
        value = getattr(magic, f"{axle}_cornering_stiffness")
        bounds[path], priors[path] = (0.2 * value, 5.0 * value), 0.2
        paths.append(path)
    curves: Mapping[str, object] = {"sideways": magic.sideways, "rear_sideways": magic.rear_sideways}
    for name, curve in curves.items():
        if curve is None:
            continue
        path = f"wheels.magic_formula.{name}"
        bounds[f"{path}.friction"], priors[f"{path}.friction"] = (0.3, 2.0), 0.15
        paths.append(f"{path}.friction")
        if magic.rear_sideways is not None:
            bounds[f"{path}.shape"], priors[f"{path}.shape"] = (0.5, 1.8), 0.2
            paths.append(f"{path}.shape")
    bounds["body.inertia.2"] = _inertia_bounds(spec)
    priors["body.inertia.2"] = TIRED
    return [*paths, "body.inertia.2"]


def _inertia_bounds(spec: VehicleSpec) -> tuple[float, float]:
    """Yaw inertias from half to twice the value with which the body is still possible."""
    x, y, z = spec.body.inertia
    return max(0.5 * z, 1.001 * abs(x - y)), min(2.0 * z, 0.999 * (x + y))


def used_by(stage: FitStage, starts: Starts) -> NDArray[np.bool_]:
    """Which starts a stage uses, a mask of shape (w,)."""
    if not stage.is_slow:
        return np.ones(len(starts.time), np.bool_)
    is_gentle = (starts.fastest < SLOW) & (starts.turning < GENTLE)
    return is_gentle if is_gentle.sum() >= LEAST_STARTS else np.ones(len(starts.time), np.bool_)
