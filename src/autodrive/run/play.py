"""Shows what a policy has learnt: as a devkit script, in a race with the page, or in its environment with the page."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from autodrive.base.errors import AutodriveError
from autodrive.connect.devkit import RoboRacer, Server
from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.registration import IDS
from autodrive.experiments.envs.settings import TASKS
from autodrive.experiments.envs.time_trial import TimeTrial
from autodrive.experiments.policies.policy import PolicyDrivers
from autodrive.experiments.policies.racer import PolicyRacer
from autodrive.run.race import RaceOptions
from autodrive.run.race import race as run_race

if TYPE_CHECKING:
    import numpy as np

    from autodrive.experiments.envs.task import Observation
    from autodrive.experiments.policies.policy import Policy
    from autodrive.run.runner import RunObserver, StopRequest
    from autodrive.world.racing.results import RaceResult


def responder(policy: Policy) -> Callable[[Mapping[str, Any]], Mapping[str, str]]:
    """The function of a devkit script (`autodrive.connect.devkit.Server`) that drives with the policy."""
    racer, car = PolicyRacer(policy), RoboRacer("V1")

    def respond(data: Mapping[str, Any]) -> Mapping[str, str]:
        car.parse_data(data)
        car.throttle_command, car.steering_command = racer.command(
            car.encoder_angles, float(car.angular_velocity[2]), car.steering, car.lidar_range_array
        )
        return car.generate_commands()

    return respond


def script(policy: Policy, port: int = 0) -> Server:
    """The policy as a devkit script on that port; 0: any free one."""
    return Server(responder(policy), port=port)


def race(
    policy: Policy, options: RaceOptions, *, stop: StopRequest | None = None, observer: RunObserver | None = None
) -> RaceResult:
    """Run a race in which the policy drives V1; the scripts of the options drive the others."""
    with ExitStack() as stack:
        server = stack.enter_context(script(policy))
        devkits = (("127.0.0.1", server.port), *options.devkits)
        return run_race(replace(options, devkits=devkits), stop=stop, observer=observer)


def play_environment(policy: Policy, steps: int | None = None) -> None:
    """Drive in the environment that the policy was trained for, in the page; None: without end."""
    import gymnasium

    ids = {task: name for name, (task, _) in IDS.items()}
    if policy.task not in ids:
        raise AutodriveError(f"the policy was trained for '{policy.task}'; known: {', '.join(ids)}, {TimeTrial.name}")
    seen = _observation(policy)
    env = gymnasium.make(f"autodrive:{ids[policy.task]}", observation=seen, render_mode="human")
    names = [feature.name for feature in observed(TASKS[policy.task](1), seen)]
    driver = PolicyDrivers(policy, names)
    features: np.ndarray = env.reset(seed=0)[0]
    for _ in itertools.count() if steps is None else range(steps):
        features, _, terminated, truncated, _ = env.step(driver.act(features)[0])
        if terminated or truncated:
            features = env.reset()[0]
            driver.begin()
    env.close()


def _observation(policy: Policy) -> Observation:
    """The observation that has all inputs of the policy."""
    task = TASKS[policy.task](1)
    choices: tuple[Observation, ...] = ("state", "lidar")
    for choice in choices:
        if set(policy.readings) <= {feature.name for feature in observed(task, choice)}:
            return choice
    raise AutodriveError(
        f"the task '{policy.task}' does not have all inputs of the policy: {', '.join(policy.readings)}"
    )
