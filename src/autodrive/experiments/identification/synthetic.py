"""Drives of simulated vehicles with the noise and the rates of real logs, for designs of drives and for tests."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

from autodrive.base.arrays import Floats
from autodrive.experiments.identification.drive import Drive
from autodrive.recording.drives import local_parabola
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.batch import BatchWorld

NAME = "V1"
TICK = 0.01
LEAD = 4.0
"""Time before the drive in which the vehicle drives straight ahead with the first throttle [s]."""


def synthetic_drive(
    vehicle: VehicleSpec,
    commands: Callable[[Floats], Floats],
    duration: float,
    title: str,
    *,
    command_period: float = 0.1,
    pose_period: float = 0.01,
    position_noise: float = 0.0,
    heading_noise: float = 0.0,
    trim: float = 0.0,
    drive: float = 1.0,
    lead: float = LEAD,
    seed: int = 0,
) -> Drive:
    """The drive of a vehicle on flat ground.

    `commands`: throttle and steering at times of shape (n,) [s], as an array of shape (n, 2); each is held for
    `command_period` [s]. `pose_period` [s], `position_noise` [m] and `heading_noise` [rad] (standard deviations): of
    the measured poses, from which speed and yaw rate follow. `trim` [rad] and `drive`: as in `BatchWorld.reset`.
    `lead` [s]: see `LEAD`.
    """
    off = {name: SensorSettings(is_on=False) for name in ("lidar", "range") if getattr(vehicle.sensors, name)}
    with tempfile.TemporaryDirectory(prefix="autodrive-") as folder:
        path = Path(folder) / "vehicle.yaml"
        path.write_text(yaml.safe_dump(vehicle.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
        placement = VehiclePlacement(type=str(path), sensors=off)
        batch = BatchWorld(ScenarioSpec(map="plane", vehicles={NAME: placement}, tick=TICK), 1, threads=1)
    held = commands(np.floor(np.arange(0.0, duration, TICK) / command_period + 1e-6) * command_period)
    readings = batch.reset(trim=trim, drive=drive)
    for _ in range(round(lead / TICK)):
        batch.step(np.array([[[held[0, 0], 0.0]]]))
    rows = []
    for i in range(len(held) + 1):
        w, _, _, z = readings.orientation[0, 0]
        rows.append((i * TICK, *readings.position[0, 0, :2], 2.0 * np.arctan2(z, w)))
        if i < len(held):
            batch.step(held[i : i + 1, None])
    batch.close()
    measured = np.array(rows)[:: max(1, round(pose_period / TICK))]
    rng = np.random.default_rng(seed)
    time, x, y, heading = measured.T
    x, y = (values + rng.normal(0.0, position_noise, len(time)) for values in (x, y))
    heading = np.unwrap(heading) + rng.normal(0.0, heading_noise, len(time))
    breaks = np.zeros(0)
    half = max(0.1, 2.5 * float(np.median(np.diff(time))))
    (_, vx), (_, vy), (_, rate) = (local_parabola(time, values, breaks, half) for values in (x, y, heading))
    speed = np.hypot(vx, vy) * np.where(np.cos(heading) * vx + np.sin(heading) * vy < 0.0, -1.0, 1.0)
    changes = np.flatnonzero(np.r_[True, (np.diff(held, axis=0) != 0.0).any(axis=1)])
    return Drive(
        time=time,
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        yaw_rate=rate,
        command_time=changes.astype(np.float64) * TICK,
        throttle=held[changes, 0],
        steering=held[changes, 1],
        is_angle=False,
        breaks=breaks,
        command_period=command_period,
        source=title,
    )
