"""Cooperative crossing: four cars Nigel, one in each arm of the map `crossing`, drive straight on through it.

The cars V1 to V4 start in the eastern, northern, western and southern arm. A car sees the three others in the order
in which they follow it in this list, V1 after V4.

Variant "published": the benchmark of the AutoDRIVE Ecosystem (arXiv 2309.10007).

- Observation, 14 numbers: x and y of the goal, then x, y, yaw and speed of each other car; positions [m] in the axes of
  the map relative to the car, yaw (0 to 2 pi each) minus that of the car [rad], speed of the wheels [m/s], all rounded
  to 0.001. The goal is the middle between the two lanes of the arm opposite.
- Actions: throttle 0.5 or 1 with steering 1, 0 or -1.
- Reward of a step: 0.01 / (0.001 + d) with the distance d [m] to the goal; -0.425 d for a collision; 1 for the goal,
  which replaces that of a collision in the same step.
- End of a car's episode: a collision, or within 0.15 m of the goal point of one of the two lanes, which is the success.
- Start: at rest in the inner lane, 1.6 m from the middle of the crossing; the goals are 1.6 m behind it. Cars that only
  drive straight on at the same speed collide. The throttle of each car is multiplied by a number from 0.9 to 1, drawn
  in each episode.

The tolerance, the places and the order of the others are choices: they are not published.

Variant "own".

- Observation: motion and goal in the vehicle frame, and what was last heard of each other car: position, direction and
  speed in the vehicle frame, and the age of that message; all about -1 to 1 (`OWN`). Of a car that was not heard yet,
  the age is 1 and the rest is 0.
- V2V: the radio channel of the scenario (`autodrive.world.rules.radio`), with `loss` and `delay`. Each car sends its
  state in every step, or `rate` times a second.
- Actions: throttle and steering, or the discrete choices of the other tasks.
- Reward of a step: how far the car has come towards its goal [m], minus 0.002; 2 for success, -2 if the episode ends
  otherwise.
- End: success within 0.15 m of the line across the goal, and in the right half of the road. Failure: a collision, a
  rear wheel beside the right half of the road, or a heading more than 60 degrees off.
- Start: at rest 1.3 to 1.9 m from the middle, in one of the two lanes, up to 0.03 m beside its middle and 0.1 rad off.
"""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan2, cos, sin
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit
from autodrive.experiments.envs.task import (
    CarReadings,
    Feature,
    Start,
    StepOutcome,
    Task,
    heading,
    turned,
    uniform,
    wrapped,
)
from autodrive.experiments.envs.variants import Variant, choices, is_published
from autodrive.protocol.commands import is_number
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.v2x import V2xSpec

MAP = "crossing"
CARS = 4
ARM = 1.6
"""Distance of starts and goals from the middle of the crossing [m]."""
LANES = 0.15, 0.45
"""Distances of the middles of both lanes from the middle of the road, to the right of it [m]."""
HALF = 0.5 * (LANES[0] + LANES[1])
"""Distance of the middle of the right half of the road from the middle of the road [m]."""
WIDTH = 0.6
"""Width of the right half of the road [m]."""
HALF_TRACK = 0.1
"""Distance from the middle of the car to the outer side of its rear wheels, rounded up [m]."""
NEAR = 0.15
"""Tolerance of a goal [m]."""
THROTTLES = 0.9, 1.0
"""Factor of the throttle of the variant "published"."""
DISTANCES, ASIDE, TURN = (1.3, 1.9), 0.03, 0.1
"""Starts of the variant "own": from the middle [m], beside the lane [m], off its direction [rad]."""
TIME_COST, END = 0.002, 2.0
"""Parts of the reward of the variant "own": cost of a step, and value of success and failure."""
COSINE = 0.5
"""Cosine of the greatest angle from the direction of the road."""
LENGTH, SPEED, AGE, STEERING, RATE = 4.0, 0.5, 20.0, 0.5, 2.0
"""Units of the observation of the variant "own": [m], [m/s], steps, [rad], [rad/s]."""
STEP_RATE = 1.0 + 1e-9
"""Messages of a car in a step: a little more than one, because one that is rounded down would be a tick too late."""

STEP, FACTOR, ARM_OF, BEFORE, ANGLE = 0, 1, 2, 3, 4
"""Columns of the memory: number of steps, factor of the throttle, number of the arm, distance that was driven [m], mean
angle of the rear wheels [rad]."""
PEER = 6
"""Numbers of the observation of the variant "own" about each other car."""

WHEEL_RADIUS = 0.0325
"""Radius of the wheels [m]: vehicles/nigel.yaml."""
OTHERS = range(1, CARS)
PUBLISHED = (
    Feature("goal_x", -10.0, 10.0, "x of the goal relative to the car, axes of the map [m]"),
    Feature("goal_y", -10.0, 10.0, "y of the goal relative to the car, axes of the map [m]"),
    *(
        Feature(f"peer_{k}_{name}", -limit, limit, text)
        for k in OTHERS
        for name, limit, text in (
            ("x", 10.0, "x of another car relative to the car, axes of the map [m]"),
            ("y", 10.0, "y of another car relative to the car, axes of the map [m]"),
            ("yaw", 2.0 * math.pi, "yaw of another car minus that of the car [rad]"),
            ("speed", 2.0, "speed of another car, from the encoders [m/s]"),
        )
    ),
)
OWN = (
    Feature("speed", -2.0, 2.0, f"forward speed / ({SPEED} m/s)"),
    Feature("yaw_rate", -2.0, 2.0, f"/ ({RATE:g} rad/s), left positive"),
    Feature("steering", -2.0, 2.0, f"angle of the steering actuator / ({STEERING} rad), left positive"),
    Feature("goal_x", -2.0, 2.0, f"x of the goal in the vehicle frame / ({LENGTH:g} m)"),
    Feature("goal_y", -2.0, 2.0, f"y of the goal in the vehicle frame / ({LENGTH:g} m)"),
    Feature("lane", -2.0, 2.0, "distance from the middle of the right half of the road / (0.3 m), left positive"),
    Feature("road_cos", -1.0, 1.0, "cosine of the angle from the car to the direction of the road"),
    Feature("road_sin", -1.0, 1.0, "sine of the angle from the car to the direction of the road, left positive"),
    *(
        Feature(f"peer_{k}_{name}", -limit, limit, text)
        for k in OTHERS
        for name, limit, text in (
            ("x", 2.0, f"x of another car in the vehicle frame, as last heard / ({LENGTH:g} m)"),
            ("y", 2.0, f"y of another car in the vehicle frame, as last heard / ({LENGTH:g} m)"),
            ("cos", 1.0, "cosine of the angle from the heading of the car to that of another car"),
            ("sin", 1.0, "sine of the angle from the heading of the car to that of another car, left positive"),
            ("speed", 2.0, f"forward speed of another car, as last heard / ({SPEED} m/s)"),
            ("age", 1.0, f"steps since the last message of another car / {AGE:g}"),
        )
    ),
)


class Crossing(Task):
    """The task of the crossing in one of its variants, which the text of the module describes."""

    name = "crossing"
    observation = "state"
    memory_size = 5

    def __init__(
        self,
        frame_skip: int,
        variant: Variant = "own",
        loss: float = 0.1,
        delay: float = 0.0,
        rate: float | None = None,
    ) -> None:
        """`loss`: probability that a message is lost, 0 to 1; `delay` of all messages [s], 0 to 10; `rate` [Hz].

        They are those of the variant "own". `rate`: 0.1 to 1000; None: a message in each step. Raises `SpecError`.
        """
        self.is_published = is_published(variant)
        self._duration = ScenarioSpec().tick * frame_skip
        rate = STEP_RATE / self._duration if rate is None else rate
        limits = {"loss": (loss, 0.0, 1.0), "delay": (delay, 0.0, 10.0), "rate": (rate, 0.1, 1e3)}
        errors = [
            f"{name}: must be a number from {least:g} to {most:g}, not {value!r}"
            for name, (value, least, most) in limits.items()
            if not (is_number(value) and least <= value <= most)
        ]
        if errors:
            raise SpecError(errors)
        self.features = PUBLISHED if self.is_published else OWN
        self.known = len(self.features)
        if self.is_published:
            self.choices = choices((0.5, 1.0))
        self.scenario = ScenarioSpec(
            map=MAP,
            vehicles={
                f"V{arm + 1}": VehiclePlacement(x=x, y=y, yaw_deg=math.degrees(yaw))
                for arm in range(CARS)
                for x, y, yaw in [_pose(arm, ARM, LANES[0], 0.0)]
            },
            v2x=None if self.is_published else V2xSpec(rate=rate, loss=loss, delay=delay),
        )

    def start(self, rng: np.random.Generator) -> Start:
        """Draw the start of the first car."""
        return self.starts(rng)[0]

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """Draw the starts of the four cars, one in each arm."""
        return [self._start(arm, rng) for arm in range(CARS)]

    def _start(self, arm: int, rng: np.random.Generator) -> Start:
        distance, right, turn, factor = ARM, LANES[0], 0.0, 1.0
        if self.is_published:
            factor = THROTTLES[0] + (THROTTLES[1] - THROTTLES[0]) * float(rng.random())
        else:
            distance = DISTANCES[0] + (DISTANCES[1] - DISTANCES[0]) * float(rng.random())
            aside, turn = uniform(rng, (ASIDE, TURN))
            right = LANES[int(rng.integers(2))] + aside
        memory = 0.0, factor, float(arm), -distance, 0.0
        return Start({f"V{arm + 1}": _pose(arm, distance, right, turn)}, memory)

    def throttle_factors(self, memory: Floats) -> Floats:
        """Factor by which the throttle of each car is multiplied, shape (n,)."""
        return memory[:, FACTOR]

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`. The cars of a world follow each other."""
        if self.is_published:
            _judge_published(cars, self._duration, memory, features, outcome)
        else:
            _judge(cars, self._duration, memory, features, outcome)


def _pose(arm: int, distance: float, right: float, turn: float) -> tuple[float, float, float]:
    """x, y [m] and yaw [rad] in an arm, heading for the middle, `right` [m] of the middle of the road."""
    along, across = DIRECTIONS[arm], DIRECTIONS[(arm + 3) % 4]
    x, y = (-distance * a + right * b for a, b in zip(along, across, strict=True))
    return x, y, wrapped(atan2(along[1], along[0]) + turn)


DIRECTIONS = np.array([(-1.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0)])
"""Direction in which the car of each arm drives, unit vectors, shape (4, 2); the right of arm k is arm (k + 3) % 4."""


@jit
def _goal(arm: int, right: float) -> tuple[float, float]:
    """x, y [m] of a point of the goal of the car of an arm, `right` of the middle of the road."""
    along, across = DIRECTIONS[arm], DIRECTIONS[(arm + 3) % 4]
    return ARM * along[0] + right * across[0], ARM * along[1] + right * across[1]


@jit
def _away(cars: CarReadings, i: int, x: float, y: float) -> float:
    """Distance of car i from a point [m]."""
    dx, dy = x - cars.position[i, 0], y - cars.position[i, 1]
    return math.sqrt(dx * dx + dy * dy)


@jit
def _rounded(value: float) -> float:
    """The value rounded to 0.001."""
    return float(np.rint(1000.0 * value) / 1000.0)


@jit
def _yaw(cars: CarReadings, i: int) -> float:
    """Yaw angle of car i, 0 to 2 pi [rad]."""
    c, s = heading(cars, i)
    yaw = atan2(s, c)
    return yaw if yaw >= 0.0 else yaw + 2.0 * math.pi


@jit
def _judge_published(
    cars: CarReadings, duration: float, memory: Floats, features: Floats, outcome: StepOutcome
) -> None:
    # speeds of all cars from their encoders, before the first observation needs them
    speed = np.zeros(len(memory))
    for i in range(len(memory)):
        angle = 0.5 * (cars.encoder_angles[i, 0] + cars.encoder_angles[i, 1])
        if memory[i, STEP] > 0.0:
            speed[i] = WHEEL_RADIUS * (angle - memory[i, ANGLE]) / duration
        memory[i, ANGLE] = angle
        memory[i, STEP] += 1.0
    # goal and other cars in the axes of the map, then the reward
    for i in range(len(memory)):
        x, y = _goal(int(memory[i, ARM_OF]), HALF)
        features[i, 0], features[i, 1] = _rounded(x - cars.position[i, 0]), _rounded(y - cars.position[i, 1])
        for k in range(1, CARS):
            j, at = i - i % CARS + (i + k) % CARS, 4 * k - 2
            features[i, at] = _rounded(cars.position[j, 0] - cars.position[i, 0])
            features[i, at + 1] = _rounded(cars.position[j, 1] - cars.position[i, 1])
            features[i, at + 2] = _rounded(_yaw(cars, j) - _yaw(cars, i))
            features[i, at + 3] = _rounded(speed[j])
        away = _away(cars, i, x, y)
        has_collided, is_there = cars.collision_count[i] > 0, False
        for right in LANES:
            x, y = _goal(int(memory[i, ARM_OF]), right)
            is_there = is_there or _away(cars, i, x, y) <= NEAR
        outcome.reward[i] = 1.0 if is_there else -0.425 * away if has_collided else 0.01 / (0.001 + away)
        outcome.has_ended[i] = is_there or has_collided
        outcome.is_success[i] = is_there


@jit
def _judge(cars: CarReadings, duration: float, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
    for i in range(len(memory)):
        arm = int(memory[i, ARM_OF])
        along, across = DIRECTIONS[arm], DIRECTIONS[(arm + 3) % 4]
        # the car in the axes of its road, from the middle of the crossing: how far it has driven, and how far right
        px, py = cars.position[i, 0], cars.position[i, 1]
        driven, right = px * along[0] + py * along[1], px * across[0] + py * across[1]
        c, s = heading(cars, i)
        x, y = _goal(arm, HALF)
        features[i, 0], features[i, 1] = cars.velocity[i, 0] / SPEED, cars.angular_velocity[i, 2] / RATE
        features[i, 2] = cars.steering[i] / STEERING
        goal_x, goal_y = turned(x - px, y - py, c, s)
        features[i, 3], features[i, 4] = goal_x / LENGTH, goal_y / LENGTH
        features[i, 5] = (HALF - right) / (0.5 * WIDTH)
        features[i, 6], features[i, 7] = turned(along[0], along[1], c, s)
        # what was last heard of the other cars, in the axes of this car as it is now
        for k in range(1, CARS):
            peer = features[i, 8 + PEER * (k - 1) : 8 + PEER * k]
            heard = cars.heard[i, (i + k) % CARS]
            if math.isnan(heard[0]):  # nothing was heard yet
                peer[:5], peer[5] = 0.0, 1.0
                continue
            x, y = turned(heard[2] - px, heard[3] - py, c, s)
            peer[0], peer[1] = x / LENGTH, y / LENGTH
            peer[2], peer[3] = turned(cos(heard[5]), sin(heard[5]), c, s)
            peer[4], peer[5] = heard[6] / SPEED, (cars.time[i] - heard[0]) / duration / AGE
        # the end: the outer side of the rear wheels beside the half of the road, or the line across the goal
        is_beside = abs(right - HALF) > 0.5 * WIDTH - HALF_TRACK
        has_failed = cars.collision_count[i] > 0 or is_beside or features[i, 6] < COSINE
        is_there = driven >= ARM - NEAR and not has_failed
        reward = driven - memory[i, BEFORE] - TIME_COST
        if has_failed:
            reward -= END
        elif is_there:
            reward += END
        outcome.reward[i] = reward
        outcome.has_ended[i] = has_failed or is_there
        outcome.is_success[i] = is_there
        memory[i, BEFORE] = driven
