"""What happened in a run, as plain values for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import autodrive
from autodrive.protocol.messages import Collision, Frame, Pose
from autodrive.transforms import euler_from_quaternion

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge
    from autodrive.simulation import Simulation


class Odometer:
    """A sink: how far each vehicle has gone, and how often it collided, over resets, teleports and other worlds."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._tick = 0
        self.distance: dict[str, float] = {}
        """Path length of the rear axle centre [m], by vehicle."""
        self.collisions: dict[str, int] = {}

    def publish(self, frame: Frame) -> None:
        """Add the way of a tick; a Frame that shows a request's result is none."""
        if frame.tick != self._tick:
            tick_duration = self._simulation.world.tick_duration
            for name, vehicle in frame.vehicles.items():
                way = math.hypot(*vehicle.velocity[:2]) * tick_duration
                self.distance[name] = self.distance.get(name, 0.0) + way
            for event in frame.events:
                if isinstance(event, Collision):
                    self.collisions[event.vehicle] = self.collisions.get(event.vehicle, 0) + 1
        self._tick = frame.tick


def run_summary(simulation: Simulation, odometer: Odometer, scenario: str, ended_by: str) -> dict[str, Any]:
    """Times, distances, collisions and final poses."""
    wall = simulation.running_time
    spec = simulation.world.spec
    return {
        "version": autodrive.__version__,
        "scenario": scenario,
        "map": spec.map,
        "seed": spec.seed,
        "speed": "max" if simulation.speed is None else simulation.speed,
        "ended_by": ended_by,
        "simulated_time": simulation.simulated_time,
        "wall_time": wall,
        "real_time_factor": simulation.simulated_time / wall if wall else 0.0,
        "ticks": simulation.ticks,
        "late_ticks": simulation.late_ticks,
        "vehicles": {
            name: {
                "mode": "autonomous" if vehicle.is_autonomous else "manual",
                "distance": odometer.distance.get(name, 0.0),
                "collisions": odometer.collisions.get(name, 0),
                "pose": _pose_summary(vehicle.pose),
            }
            for name, vehicle in simulation.frame.vehicles.items()
        },
    }


def bridge_summary(bridge: DevkitBridge) -> dict[str, Any] | None:
    """Counters of the bridge; None if it was never used. Numbers that are not there yet are null."""
    counters = bridge.counters
    if bridge.status == "closed" and not counters.connections:
        return None
    return {
        "address": bridge.address,
        "dialect": counters.dialect and str(getattr(counters.dialect, "value", counters.dialect)),
        "profile": counters.profile,
        "connections": counters.connections,
        "reconnects": counters.reconnects,
        "telemetry_sent": counters.telemetry_sent,
        "commands_received": counters.commands_received,
        "resends": counters.resends,
        "refused_values": counters.refused_values,
        "round_trip": None if math.isnan(counters.round_trip) else counters.round_trip,
    }


def _pose_summary(pose: Pose) -> dict[str, Any]:
    return {
        "position": [float(value) for value in pose.position],
        "orientation": [float(value) for value in pose.orientation],
        "yaw": float(euler_from_quaternion(pose.orientation)[2]),
    }
