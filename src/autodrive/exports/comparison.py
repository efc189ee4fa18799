"""Compares a drive of AutoDRIVE's data recorder with our simulation of its commands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from autodrive.exports.recorder_layout import DriveLog
from autodrive.factory import make
from autodrive.protocol.messages import Command
from autodrive.scenario import ScenarioSpec, load_scenario


@dataclass(frozen=True)
class Comparison:
    """A recorded drive and ours, at the times of the recorded one. Both start at the same pose; ours starts at rest."""

    time: NDArray[np.float64]
    """[s], shape (n,)."""
    recorded: dict[str, NDArray[np.float64]]
    """'speed' [m/s], 'yaw rate' [rad/s], 'x' and 'y' [m], each of shape (n,)."""
    simulated: dict[str, NDArray[np.float64]]
    """Likewise."""

    @property
    def errors(self) -> dict[str, tuple[float, float]]:
        """Root mean square and greatest error of 'speed', 'yaw rate' and 'path' (distance at the same time [m])."""
        found = {name: self.simulated[name] - self.recorded[name] for name in ("speed", "yaw rate")}
        dx, dy = (self.simulated[name] - self.recorded[name] for name in ("x", "y"))
        found["path"] = np.hypot(dx, dy)
        return {name: (float(np.sqrt(np.mean(of**2))), float(np.max(np.abs(of)))) for name, of in found.items()}

    def table(self) -> str:
        """The errors as text."""
        units = {"speed": "m/s", "yaw rate": "rad/s", "path": "m"}
        rows = [f"{'':10}{'rms':>10}{'greatest':>10}"]
        rows += [f"{name:10}{rms:10.4f}{most:10.4f}  {units[name]}" for name, (rms, most) in self.errors.items()]
        return "\n".join(rows)


def compare(log: DriveLog, scenario: str | Path | ScenarioSpec) -> Comparison:
    """Simulate the commands of a drive from its first pose, with the first vehicle of a scenario.

    The log has the feedback of throttle and steering, not the commands: the value of a row is commanded from the row
    before it on.
    """
    spec = scenario if isinstance(scenario, ScenarioSpec) else load_scenario(scenario)
    world = make(spec)
    name = world.vehicle_names[0]
    limit = world.vehicle_specs[name].steering.limit
    x, y = log.position[0, :2].tolist()
    world.reset(poses={name: (x, y, float(log.euler[0, 2]))})
    rows: list[list[float]] = []
    for i, time in enumerate(log.time.tolist()):
        while world.time < time - 0.5 * world.tick_duration:
            world.step({name: Command(float(log.throttle[i]), float(log.steering[i]) / limit)})
        frame = world.frame.vehicles[name]
        rows.append([frame.speed, frame.imu.angular_velocity[2], *frame.ips.position[:2]])
    ours = np.array(rows, np.float64)
    recorded = {
        "speed": np.abs(log.speed),
        "yaw rate": log.angular_velocity[:, 2],
        "x": log.position[:, 0],
        "y": log.position[:, 1],
    }
    simulated = {"speed": np.abs(ours[:, 0]), "yaw rate": ours[:, 1], "x": ours[:, 2], "y": ours[:, 3]}
    return Comparison(log.time, recorded, simulated)
