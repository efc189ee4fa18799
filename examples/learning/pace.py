"""Learns how fast a policy may drive: a second network, which feels how much grip and latency the car has.

Give it a trained policy. It drives with random grip, mass, latency and slowness, and learns the slowness with which the
policy collides as seldom as in normal conditions; the output is the same policy with a pace:
    python examples/learning/pace.py runs/robust/policy.npz --minutes 10 --output runs/paced/policy.npz
    autodrive play runs/paced/policy.npz practice

1. Drive: each car has its own conditions and its own slowness (`Policy.slower`) in each episode. What it feels (speed
   of the wheels, yaw rate, steering) and does is recorded, and whether it collides.
2. Fit: how often it collides, given conditions and slowness (Poisson regression). From this follows the slowness that
   conditions need.
3. Learn: a network estimates that slowness from the last 0.5 s of what the car feels and does, and how much its
   estimate is worth: on a straight it learns little. The weighted mean over the last seconds counts. Nobody tells the
   car its conditions when it drives; the idea is that of rapid motor adaptation (Kumar et al., arXiv:2107.04034).
4. Limit: the result has a top speed. From a higher one the policy brakes too late with a heavy car or with latency,
   which a slowness helps little, as the car feels little of its mass. The drives have no such limit.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import optax

from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.policy import Pace, PolicyDrivers, PolicyMemory
from autodrive.experiments.policies.racer import PERIOD

CARS = 64
CONDITIONS = {"noise": (0.0, 2.0), "friction": (0.7, 1.25), "mass": (0.75, 1.25), "latency": (0.0, 0.055)}
TIGHT = {"track_width": (0.9, 1.8), "track_length": (60.0, 115.0), "track_radius": (0.8, 1.6)}
WIDE = {"track_width": (1.5, 2.0), "track_length": (95.0, 120.0), "track_radius": (1.4, 2.5)}
TRACKS = (TIGHT, 0.97), (WIDE, 1.0)  # and the slowness on them in normal conditions: wide ones are more dangerous
COMMON = {"tracks": 64, "track_seed": 700, "track_area": (44.0, 18.0), **CONDITIONS}
SLOWNESS = 0.95, 1.3  # of the drives
SLOWEST = 1.4  # of the pace, which begins with it
KEEP = 1.0 - PERIOD / 30.0  # of a weight in each step: a time constant of 30 s
START = 2.0  # the beginning counts as much as so long a drive [s]
TOP_SPEED = 25.252  # of throttle 1 [m/s]
MOTION, DONE = ("wheel_speed", "yaw_rate", "steering"), ("steer", "throttle")
MOMENTS = 20
SCALES = {"wheel_speed": 0.2, "yaw_rate": 0.3, "steering": 2.0, "steer": 1.0, "throttle": 4.0}
INPUTS = (
    *(f"{name}@{k}" if k else name for k in range(MOMENTS + 1) for name in MOTION),
    *(f"{name}@{k}" for k in range(1, MOMENTS + 1) for name in DONE),
)
SCALE = np.array([SCALES[name.partition("@")[0]] for name in INPUTS], np.float32)
WIDTH = 64
STRIDE, WINDOW = 4, 250  # each fourth step is recorded; of them so many are a sequence
BATCH, UPDATES, RATE = 64, 8000, 2e-3
FAST = 2.0  # how much more an estimate counts that is too fast


class Drives(NamedTuple):
    """What happened. With a row for each step that is recorded, or for each episode."""

    felt: np.ndarray
    """`INPUTS`, shape (n_step, CARS, n_input)."""
    conditions: np.ndarray
    """Friction, mass, noise, latency [s] and slowness, shape (n_step, CARS, 5)."""
    episode: np.ndarray
    """Number of the episode, shape (n_step, CARS)."""
    episodes: np.ndarray
    """Its conditions, its duration [s], and whether it ended by a collision, shape (n_episode, 7)."""


def drive(policy: Policy, tracks: dict[str, Any], seed: int, minutes: float) -> Drives:
    """Drive in random conditions for so long, on tracks with these settings."""
    envs: Any = gymnasium.make_vec(
        "autodrive:RoboRacer-v0",
        num_envs=CARS,
        vectorization_mode="vector_entry_point",
        observation="lidar",
        autoreset_mode="SameStep",
        **{**COMMON, **tracks},
    ).unwrapped
    names = [one.name for one in observed(envs.task, "lidar")]
    drivers, memory = PolicyDrivers(policy, names, CARS), PolicyMemory(INPUTS, names, CARS)
    period = envs.batch.tick_duration * envs.settings.frame_skip
    rng, slowness = np.random.default_rng(seed), drivers.slowness
    felt, conditions, episode, episodes = [], [], [], []
    number, began, is_over = np.zeros(CARS, int), np.zeros(CARS, int), np.ones(CARS, np.bool_)
    ended = np.zeros((CARS, 7))
    observation, _ = envs.reset(seed=seed)
    envs.steps[:] = rng.integers(0, 1000, CARS)  # not all end at once
    end, step, count = time.monotonic() + 60.0 * minutes, 0, 0
    while time.monotonic() < end:
        for one in (drivers.begin_episodes, memory.begin):
            one(observation[is_over], is_over)
        new = int(is_over.sum())
        number[is_over], count = count + np.arange(new), count + new
        slowness[is_over], began[is_over] = rng.uniform(*SLOWNESS, new), step
        drawn = np.column_stack([envs.drawn[:, :4], slowness])  # friction, mass, noise, latency
        if step % STRIDE == 0:
            felt.append(np.float32(memory.inputs))
            conditions.append(drawn)
            episode.append(number.copy())
        commands = drivers.commands()
        memory.put_out(drivers.outputs, commands[:, 0])
        observation, _, terminated, truncated, _ = envs.step(commands)
        step += 1
        is_over = terminated | truncated
        ended[:] = np.column_stack([drawn, (step - began) * period, terminated])
        episodes += list(ended[is_over])
        if is_over.any():
            print(f"\r{step * CARS} steps, {sum(one[-1] for one in episodes):.0f} collisions", end="", flush=True)
        for one in (drivers, memory):
            one.add(observation)
    return Drives(*map(np.array, (felt, conditions, episode, [*episodes, *ended[~is_over]])))


class Risk(NamedTuple):
    """How often the policy collides, by Poisson regression: log rate = constant + coefficients * `quantities`."""

    coefficients: np.ndarray
    errors: np.ndarray
    """Standard errors of them."""

    def slowness(self, conditions: np.ndarray) -> np.ndarray:
        """With which it collides as seldom as with slowness 1 in normal conditions, shape (...,); (..., 4) go in."""
        drawn = np.concatenate([conditions, np.ones((*conditions.shape[:-1], 1))], -1)
        drawn[..., 2] = 1.0  # noise of the LIDAR cannot be felt
        return np.exp(-(quantities(drawn) @ self.coefficients) / self.coefficients[-1])


def quantities(conditions: np.ndarray) -> np.ndarray:
    """What the rate of collisions depends on, zero in normal conditions, shape (..., 8); conditions: see `Drives`."""
    friction, mass, noise, latency, slowness = np.moveaxis(conditions, -1, 0)
    friction, mass, latency = np.log(friction), np.log(mass), latency / 0.04
    squares = friction**2, mass**2, latency**2
    return np.stack([friction, mass, latency, *squares, noise - 1.0, np.log(slowness)], -1)


def fit(episodes: np.ndarray) -> Risk:
    """The most probable coefficients, by Newton's method."""
    duration, collided = episodes[:, -2:].T
    known = np.column_stack([quantities(episodes[:, :5]), np.ones(len(episodes))])
    weights = np.zeros(known.shape[1])
    weights[-1] = np.log(max(collided.sum(), 0.5) / duration.sum())
    curvature = np.eye(len(weights))
    for _ in range(100):
        expected = duration * np.exp(known @ weights)
        curvature = (known.T * expected) @ known + 1e-3 * np.eye(len(weights))
        weights += np.clip(np.linalg.solve(curvature, known.T @ (collided - expected)), -1.0, 1.0)
    return Risk(weights[:-1], np.sqrt(np.diag(np.linalg.inv(curvature)))[:-1])


def sequences(drives: Drives) -> tuple[np.ndarray, np.ndarray]:
    """What was felt, shape (n, WINDOW, n_input), and the conditions of each, shape (n, 4)."""
    felt, conditions = [], []
    for car in range(CARS):
        number = drives.episode[:, car]
        for one in np.unique(number):
            rows = np.flatnonzero(number == one)
            for first in range(0, len(rows) - WINDOW + 1, WINDOW):
                felt.append(drives.felt[rows[first : first + WINDOW], car])
                conditions.append(drives.conditions[rows[first], car, :4])
    return np.array(felt), np.array(conditions)


def estimates(network: eqx.nn.MLP, felt: jax.Array) -> jax.Array:
    """The estimates in a sequence, as `Pace` makes them, shape (WINDOW,); `felt`: scaled, shape (WINDOW, n_input)."""
    value, log_weight = jax.vmap(network)(felt).T
    weight = STRIDE * jnp.exp(jnp.clip(log_weight, -20.0, 20.0))

    def step(sums, more):
        sums = KEEP**STRIDE * sums + more
        return sums, sums

    _, sums = jax.lax.scan(step, jnp.array([SLOWEST, 1.0]), jnp.stack([weight * value, weight], 1))
    return sums[:, 0] / sums[:, 1]


def loss(network: eqx.nn.MLP, felt: jax.Array, wanted: jax.Array) -> jax.Array:
    """Mean squared error, in which an estimate that is too fast counts more."""
    error = jax.vmap(lambda one: estimates(network, one))(felt) - wanted[:, None]
    return jnp.mean(jnp.where(error < 0.0, FAST, 1.0) * error**2)


def learn(felt: np.ndarray, wanted: np.ndarray, seed: int) -> eqx.nn.MLP:
    """The network; a tenth of the sequences is not learnt from, and shows how well it estimates."""
    network = eqx.nn.MLP(len(INPUTS), 2, WIDTH, 2, jnp.tanh, key=jax.random.PRNGKey(seed))
    first = 0.1 * network.layers[-1].weight, jnp.array([float(wanted.mean()), -1.0])
    network = eqx.tree_at(lambda one: (one.layers[-1].weight, one.layers[-1].bias), network, first)
    rate = optax.cosine_decay_schedule(RATE, UPDATES)
    optimizer = optax.chain(optax.clip_by_global_norm(0.1), optax.adam(rate))
    memory = optimizer.init(eqx.filter(network, eqx.is_inexact_array))

    @eqx.filter_jit
    def update(network, memory, felt, wanted):
        gradient = eqx.filter_grad(loss)(network, felt, wanted)
        changes, memory = optimizer.update(gradient, memory)
        return eqx.apply_updates(network, changes), memory

    rng = np.random.default_rng(seed)
    order = rng.permutation(len(felt))
    tried, learnt = order[: len(order) // 10 + 1], order[len(order) // 10 :]
    felt = felt * SCALE
    for _ in range(UPDATES):
        chosen = rng.choice(learnt, BATCH)
        network, memory = update(network, memory, jnp.asarray(felt[chosen]), jnp.asarray(wanted[chosen]))
    found = np.array(eqx.filter_jit(jax.vmap(lambda one: estimates(network, one)))(jnp.asarray(felt[tried])))[:, -1]
    error = float(np.sqrt(np.mean((found - wanted[tried]) ** 2)))
    print(f"error of the slowness {error:.3f}, where it varies by {wanted.std():.3f}")
    return network


def pace(network: eqx.nn.MLP, felt: np.ndarray, top_speed: float) -> Pace:
    """What was learnt, with a careful beginning; `felt`: see `sequences`, `top_speed` [m/s]."""
    layers = tuple((np.array(one.weight), np.array(one.bias)) for one in network.layers)
    some = felt[:: 1 + len(felt) // 200].reshape(-1, len(INPUTS))
    log_weight = jax.vmap(network)(jnp.asarray(some * SCALE))[:, 1]
    layers[-1][1][1] -= np.log(np.mean(np.exp(np.clip(log_weight, -20.0, 20.0))) * START / PERIOD)
    slowness = min(normal for _, normal in TRACKS), SLOWEST
    return Pace(INPUTS, tuple(SCALE.tolist()), slowness, KEEP, layers, top_speed / TOP_SPEED)


def main() -> None:
    """Drive, fit, learn, and write the policy."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("policy", help="name of an included policy, or path of its file")
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    parser.add_argument("--minutes", type=float, default=15.0, help="of driving")
    parser.add_argument("--care", type=float, default=1.5, help="factor of how much slower than in normal conditions")
    parser.add_argument("--top-speed", type=float, default=7.0, help="of the result [m/s]")
    parser.add_argument("--output", type=Path, default=Path("runs/paced/policy.npz"), help="file of the result")
    options = parser.parse_args()
    if not 0.0 < options.top_speed <= TOP_SPEED:
        parser.error(f"--top-speed must be over 0 and at most {TOP_SPEED}, not {options.top_speed:g}")
    options.output.parent.mkdir(parents=True, exist_ok=True)
    policy = replace(Policy.find(options.policy), pace=None)
    felt, wanted = [], []
    for tracks, normal in TRACKS:
        drives = drive(policy, tracks, options.seed, options.minutes / len(TRACKS))
        risk = fit(drives.episodes)
        print("\nlog rate of collisions:", np.round(risk.coefficients, 2), "+-", np.round(risk.errors, 2))
        there, conditions = sequences(drives)
        felt.append(there)
        wanted.append(normal * (1.0 + options.care * (risk.slowness(conditions) - 1.0)))
    targets = np.clip(np.concatenate(wanted), 0.5, SLOWEST).astype(np.float32)
    everything = np.concatenate(felt)
    learnt = pace(learn(everything, targets, options.seed), everything, options.top_speed)
    about = {name: getattr(options, name) for name in ("minutes", "seed", "care", "top_speed")}
    replace(policy, pace=learnt, training={**policy.training, "pace": about}).save(options.output)


if __name__ == "__main__":
    main()
