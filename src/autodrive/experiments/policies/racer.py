"""Drives the car RoboRacer with a policy, by what a script may read in a race: LIDAR, encoders, gyroscope, steering."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import AutodriveError
from autodrive.experiments.envs.time_trial import TimeTrial, wheel_speed
from autodrive.experiments.policies.policy import PolicyDrivers
from autodrive.protocol.messages import Command, VehicleFrame
from autodrive.scenario import RaceSpec, ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.maps.map import load_map
from autodrive.world.compile import on_grid
from autodrive.world.factory import make
from autodrive.world.racing.results import RaceRecorder

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.experiments.envs.task import CarReadings
    from autodrive.experiments.policies.policy import Policy
    from autodrive.world.racing.results import Standing

PERIOD = 0.025
"""Time between two scans, and so between two commands [s]."""
_SCAN = TimeTrial.scan
INPUTS = ("wheel_speed", "yaw_rate", "steering", *(f"range_{bearing:g}" for bearing in _SCAN.bearings))
"""Features of the time trial that these readings give."""


class PolicyRacer:
    """Drives race cars with a policy; remembers the last angles of the wheels and what the policy remembers.

    Raises `AutodriveError` if the policy needs other readings.
    """

    def __init__(self, policy: Policy, count: int = 1) -> None:
        unknown = sorted(set(policy.readings) - set(INPUTS))
        if unknown:
            known = f"{', '.join(INPUTS[:4])}, ... {INPUTS[-1]}"
            raise AutodriveError(
                f"the policy reads {unknown[0]}, which no script can read in a race; a script can read {known}"
            )
        self._drivers = PolicyDrivers(policy, INPUTS, count)
        self._angle: Floats | None = None

    def commands(self, angles: Floats, yaw_rate: Floats, steering: Floats, ranges: Floats) -> Floats:
        """Throttle and steering, -1 to 1, left positive, shape (n, 2), for the readings after one more `PERIOD`.

        `angles` of the rear wheels [rad], shape (n, 2); `yaw_rate` [rad/s] and `steering` angle [rad], left positive,
        shape (n,); `ranges` of the scans from right to left [m], shape (n, 1080) or
        (n, 1081).
        """
        angle = 0.5 * (angles[:, 0] + angles[:, 1])
        turned = np.zeros(len(angle)) if self._angle is None else angle - self._angle
        self._angle = angle
        speed = [wheel_speed(turned_of_car, PERIOD) for turned_of_car in turned.tolist()]
        return self._drivers.act(np.column_stack([speed, yaw_rate, steering, sectors(ranges)]))

    def command(self, angles: Floats, yaw_rate: float, steering: float, ranges: Floats) -> tuple[float, float]:
        """Throttle and steering of one car; `angles` of the shape (2,), `ranges` of the shape (1080,) or (1081,)."""
        readings = np.asarray(angles)[None], np.array([yaw_rate]), np.array([steering]), np.asarray(ranges)[None]
        throttle, steer = self.commands(*readings)[0].tolist()
        return throttle, steer

    def act(self, car: VehicleFrame) -> Command:
        """The command for a Frame of one car."""
        if car.lidar is None:
            raise AutodriveError("the policy needs a car with a LIDAR")
        rate = float(car.imu.angular_velocity[2])
        return Command(*self.command(car.encoders.angles, rate, car.steering, car.lidar.ranges))

    def act_all(self, _: NDArray[np.float32], cars: CarReadings) -> Floats:
        """The commands for the readings of environments, shape (count, 2): throttle and steering."""
        return self.commands(cars.encoder_angles, cars.angular_velocity[:, 2], cars.steering, cars.lidar_ranges)


def sectors(ranges: Floats) -> Floats:
    """The shortest range in each sector of scans, within its limits [m], shape (..., 54), without a ray at its end."""
    each, rest = divmod(ranges.shape[-1], _SCAN.sectors)
    if not each or rest > 1:
        raise AutodriveError(f"the policy needs a scan of 1080 or 1081 rays, not of {ranges.shape[-1]}")
    rays = ranges[..., : each * _SCAN.sectors].reshape(*ranges.shape[:-1], _SCAN.sectors, each)
    return np.clip(rays.min(axis=-1), 0.0, _SCAN.range_max)


def drive_laps(policy: Policy, track: str, laps: int = 10, *, limit: float = 600.0, seed: int = 0) -> Standing:
    """Laps and collisions of a time trial in lock-step on a track, by the rules 'practice'.

    It ends after `laps`, a collision or `limit` [s]. The LIDAR has the noise of its data sheet, with that seed. Raises
    `SpecError` for an unknown track.
    """
    car = VehiclePlacement(type="roboracer", sensors={"lidar": SensorSettings(noise="realistic")})
    rules = RaceSpec(rules="practice", laps=laps)
    scenario = ScenarioSpec(map=track, vehicles={"V1": car}, race=rules, tick=PERIOD, seed=seed)
    with closing(make(on_grid(scenario, load_map(track)))) as world:
        racer, recorder = PolicyRacer(policy), RaceRecorder()
        recorder.publish(world.frame)
        while not recorder.is_over and world.time < limit and not world.frame.vehicles["V1"].collision_count:
            recorder.publish(world.step({"V1": racer.act(world.frame.vehicles["V1"])}))
        (standing,) = recorder.standings()
    return standing
