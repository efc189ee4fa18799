"""Shows a measured car beside the car that the simulator predicts from its commands, as a recording."""

from __future__ import annotations

import itertools
import math
from contextlib import closing
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.physics.sensors.own import SensorView
from autodrive.recording import Recorder, RecordingError
from autodrive.recording.drives import Drive
from autodrive.recording.exports.comparison import in_commands, start_motion
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle
from autodrive.world import World
from autodrive.world.batch import BatchWorld
from autodrive.world.factory import new_world

NAME = "V1"
"""The measured car."""
SENSOR = "twin"
"""Name of the signal of the gap: 'V1/own/twin'."""
DRAWN, PATH_DRAWN = 4, 20
"""Ticks between two drawings of the predicted car, and of the paths."""
PATH = 100
"""Points of a drawn path."""
PREDICTED, MEASURED = "#ff9500", "#2090ff"
"""Colours of the predicted car and of the path of the measured car."""


class _Gap:
    """The sensor whose values are the distance between both cars."""

    rate = 25.0
    columns = ("position [m]", "heading [deg]")

    def __init__(self) -> None:
        self.values = (0.0, 0.0)

    def sample(self, view: SensorView, random: np.random.Generator) -> tuple[float, float]:
        """Position [m] and heading [degrees] of the predicted car minus those of the measured car."""
        return self.values


def record_twin(drive: Drive, vehicle: str, path: Path, *, restart: float = 5.0) -> Floats:
    """Record the measured car as vehicle 'V1' on the plane, and the predicted car as a drawing.

    `vehicle`: name or file of the vehicle that predicts. It starts as measured, and again after `restart` [s] and after
    each of the breaks. The signal 'V1/own/twin' is the gap. Returns the distance of both cars in each tick [m], shape
    (t,). Raises `RecordingError` or `SpecError`.
    """
    if not restart > 0.0:
        raise RecordingError(f"the time after which the prediction starts again must be positive, not {restart:g} s")
    spec = load_vehicle(vehicle)
    off = {name: SensorSettings(is_on=False) for name in ("lidar", "range") if getattr(spec.sensors, name) is not None}
    scenario = ScenarioSpec(
        map="plane",
        vehicles={NAME: VehiclePlacement(type=vehicle, sensors=off)},
        tick=drive.tick,
        substep=drive.substep,
    )
    drive = in_commands(drive, spec)
    gap = _Gap()
    with closing(BatchWorld(scenario, threads=1)) as batch, closing(new_world(scenario)) as world:
        world.add_sensor(NAME, SENSOR, gap)
        with Recorder(path, world, name="twin"):
            return _recorded(drive, spec, batch, world, gap, restart)


def _recorded(drive: Drive, spec: VehicleSpec, batch: BatchWorld, world: World, gap: _Gap, restart: float) -> Floats:
    tick = batch.tick_duration
    times = drive.time[0] + tick * np.arange(math.floor(drive.duration / tick) + 1)
    rows = np.searchsorted(drive.time, times + 1e-9, side="right") - 1
    part = np.searchsorted(drive.breaks, drive.time, side="right")
    columns = (drive.x, drive.y, np.unwrap(drive.heading))
    measured = np.array([_held(drive, column, times, rows, part) for column in columns])
    held = np.clip(np.searchsorted(drive.command_time, times + 0.5 * tick, side="right") - 1, 0, None)
    commands = np.zeros((1, len(batch.commanded_names), 2))
    predicted = np.empty((3, len(times)))
    started = -math.inf
    for i, (time, row) in enumerate(zip(times.tolist(), rows.tolist(), strict=True)):
        is_new_part = i > 0 and part[row] != part[rows[i - 1]]
        if is_new_part or time - started >= restart - 0.5 * tick:
            end = int(np.searchsorted(part, part[row], side="right"))
            motion = start_motion(drive, range(row, end))
            readings = batch.reset(poses={NAME: tuple(measured[:, i].tolist())}, motions={NAME: motion})
            started = time
        else:
            commands[0, 0] = drive.throttle[held[i - 1]], drive.steering[held[i - 1]]
            readings = batch.step(commands)
        w, z = readings.orientation[0, 0, [0, 3]].tolist()
        predicted[:, i] = *readings.position[0, 0, :2], 2.0 * math.atan2(z, w)
        turn = math.remainder(predicted[2, i] - measured[2, i], 2.0 * math.pi)
        gap.values = math.dist(predicted[:2, i], measured[:2, i]), math.degrees(turn)
        world.set_poses({NAME: np.array(spec.standing(*measured[:, i].tolist()))})
        if i % DRAWN == 0:
            _draw(world, spec, predicted[:, i], gap.values[0])
        if i and i % PATH_DRAWN == 0:
            for name, line, color in (("measured path", measured, MEASURED), ("predicted path", predicted, PREDICTED)):
                world.draw.path(line[:2, max(0, i - 4 * PATH) : i + 1 : 4].T, name=name, color=color, width=0.01)
        world.step()
    return np.hypot(*(predicted - measured)[:2])


def _held(drive: Drive, values: Floats, times: Floats, rows: Integers, part: Integers) -> Floats:
    """The values of a column at some times, between two rows; before a break those of the last row."""
    following = np.minimum(rows + 1, len(values) - 1)
    return np.where(part[following] == part[rows], np.interp(times, drive.time, values), values[rows])


def _draw(world: World, spec: VehicleSpec, pose: Floats, distance: float) -> None:
    """Draw the outline of the predicted car, and how far away it is."""
    x, y, heading = pose.tolist()
    half = 0.6 * spec.track
    rear, front = -0.25 * spec.wheelbase, 1.25 * spec.wheelbase
    corners = [(rear, -half), (front, -half), (front + half, 0.0), (front, half), (rear, half), (rear, -half)]
    forward, side = (math.cos(heading), math.sin(heading)), (-math.sin(heading), math.cos(heading))
    outline = [
        (x + ahead * forward[0] + left * side[0], y + ahead * forward[1] + left * side[1]) for ahead, left in corners
    ]
    height = 2.0 * spec.wheels.radius
    for name, z in (("predicted", height), ("predicted, below", 0.01)):
        points = [(*point, z) for pair in itertools.pairwise(outline) for point in pair]
        world.draw.lines(points, name=name, color=PREDICTED, width=0.01)
    world.draw.text(f"{100.0 * distance:.0f} cm", (x, y, height + 0.15), name="gap")
