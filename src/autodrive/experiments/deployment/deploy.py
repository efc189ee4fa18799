"""Writes the folder with which a policy drives a real car: driver, nodes for ROS 1 and ROS 2, settings, policy."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.base.cache import write_file
from autodrive.base.errors import SpecError
from autodrive.experiments.deployment.driver import READINGS, CarDriver, CarError, CarSettings, changed
from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.time_trial import TICK, TimeTrial
from autodrive.experiments.policies.policy import Policy
from autodrive.scenario.vehicles.spec import load_vehicle

if TYPE_CHECKING:
    from autodrive.scenario.vehicles.spec import VehicleSpec

CAR = Path(__file__).with_name("car")
DRIVER = Path(__file__).with_name("driver.py")
NODES = "ros2_node.py", "ros1_node.py", "devkit_script.py", "README.md"
"""Files of `CAR`."""
STEP = 5
"""Ticks of a step of the time trial by default (`RoboRacerVectorEnv`)."""
SCAN = TimeTrial.scan
KNOWN = *READINGS, *(f"range_{bearing:g}" for bearing in SCAN.bearings)
"""What a policy for a car may read."""


def settings_for(vehicle: VehicleSpec, car: VehicleSpec, changes: Sequence[str] = ()) -> CarSettings:
    """The settings of a policy that was trained with `vehicle`, for a real car that `car` describes.

    `changes`: texts NAME=VALUE. Raises `SpecError` for a vehicle without a LIDAR, and for wrong changes.
    """
    for spec in (vehicle, car):
        if spec.sensors.lidar is None:
            raise SpecError([f"the vehicle '{spec.title}' has no LIDAR, which the policy needs"])
    places = [spec.sensors.lidar.mount.position for spec in (vehicle, car) if spec.sensors.lidar is not None]
    values: dict[str, Any] = {
        "period": TICK * STEP,
        "full_speed": round(vehicle.full_throttle_speed, 4),
        "full_angle": round(vehicle.steering.limit, 6),
        "policy_lidar": places[0][:2],
        "first_degree": SCAN.first_degree,
        "sector_degrees": SCAN.degrees,
        "sectors": SCAN.sectors,
        "sector_range": SCAN.range_max,
        "car_full_speed": round(car.full_throttle_speed, 4),
        "wheelbase": car.wheelbase,
        "wheel_radius": car.wheels.radius,
        "front": round(car.front, 4),
        "half_width": round(0.5 * car.size[1], 4),
        "lidar": places[1][:2],
        "lidar_yaw": round(math.radians(car.sensors.lidar.mount.rotation_deg[2]), 6) if car.sensors.lidar else 0.0,
        "steering_limit": round(car.steering.limit, 6),
        "steering_unwinds_at_once": car.steering.unwinds_at_once,
    }
    if car.steering.rate_limit is not None:
        values["steering_rate"] = car.steering.rate_limit
    try:
        return CarSettings.checked({**values, **changed(changes)})
    except CarError as error:
        raise SpecError([str(error)]) from None


def deploy(
    policy: str, folder: Path, *, vehicle: str = "roboracer", car: str | None = None, changes: Sequence[str] = ()
) -> list[Path]:
    """Write the folder; returns its files.

    `policy`: name of an included policy, or an .npz or .onnx file. `vehicle`: name or file of that with which it was
    trained. `car`: vehicle that describes the car; None: the same. `changes`: texts NAME=VALUE for `CarSettings`.
    Raises `SpecError`.
    """
    settings = settings_for(load_vehicle(vehicle), load_vehicle(car or vehicle), changes)
    folder.mkdir(parents=True, exist_ok=True)
    files = {name: (CAR / name).read_bytes() for name in NODES}
    files |= {"driver.py": DRIVER.read_bytes(), "settings.json": settings.json().encode()}
    write_policy(policy, folder / settings.policy)
    for name, content in files.items():
        write_file(folder / name, content)
    try:
        CarDriver(settings, folder)  # what is wrong is said here, not on the car
    except CarError as error:
        raise SpecError([str(error)]) from None
    return [folder / name for name in sorted([*files, settings.policy])]


def write_policy(policy: str, file: Path) -> None:
    """Write the file of a policy for a car; see `deploy`. Raises `SpecError` for a policy that no car can use."""
    if Path(policy).suffix == ".onnx":
        write_file(file, onnx_policy(Path(policy)))
    else:
        _checked(policy).save(file)


def _checked(name: str) -> Policy:
    """A policy that a car can drive with. Raises `SpecError` for another one."""
    policy = Policy.find(name)
    if policy.task != TimeTrial.name:
        raise SpecError([
            f"policy '{name}' was trained for the task '{policy.task}'; a car can be driven by a policy of "
            f"'{TimeTrial.name}', which reads a scan"
        ])  # fmt: skip
    unknown = sorted(set(policy.readings) - set(KNOWN))
    if unknown:
        raise SpecError([
            f"policy '{name}' reads {unknown[0]}, which a car does not measure. A policy for a car reads "
            f"{', '.join(READINGS)}, range_{SCAN.bearings[0]:g}, ... range_{SCAN.bearings[-1]:g}"
        ])  # fmt: skip
    return policy


def onnx_policy(file: Path) -> bytes:
    """The network of an ONNX file as a policy file for a car.

    Its input is the observation 'lidar' of `RoboRacer-v0`, its outputs are throttle and steering. Raises `SpecError`.
    """
    if find_spec("onnx") is None:
        raise SpecError([f"{file}: an ONNX file needs the package onnx; install it with:  pip install -e '.[onnx]'"])
    from autodrive.experiments.deployment.onnx_layers import read_layers  # noqa: PLC0415  needs the extra onnx

    names = [feature.name for feature in observed(TimeTrial(STEP), "lidar")]
    assert set(names) <= set(KNOWN)
    network = read_layers(file, len(names))
    about = {
        "format": 1,
        "task": TimeTrial.name,
        "inputs": names,
        "scale": [1.0] * len(names),
        "throttle": [-1.0, 1.0],
        "activations": network.activations,
        "training": {"from": file.name},
    }
    arrays: dict[str, Any] = {"about": np.array(json.dumps(about))}
    for number, (weight, bias) in enumerate(network.layers):
        arrays |= {f"weight_{number}": weight, f"bias_{number}": bias}
    data = io.BytesIO()
    np.savez(data, allow_pickle=False, **arrays)
    return data.getvalue()
