"""Learns to drive from nothing, on a laptop without a GPU: PPO in JAX on the batched environments.

Install it, train, and watch the result:
    pip install -e '.[envs,learn]'
    python examples/learning/ppo.py race --seed 1 --output runs/race
    autodrive play runs/race/policy.npz practice

Problems: "race" (car RoboRacer, LIDAR, random tracks), "robust" (the same with more latency, noise, other grip and
mass, and dearer collisions), "duel" (two of them in each race, driven by the policy that learns, by itself as it was,
or by other drivers), "overtake" (such a driver learns to keep its distance and to pass), "crossing" (four cars Nigel
drive through a crossing, all driven by the policy that learns), and "lane" (car Nigel, lane keeping). `--begin-with`
gives "robust", "duel" and "overtake" the beginning: runs/race, or a policy. The output folder gets checkpoint.eqx,
policy.npz, curve.csv and curve.svg; the same command with --resume goes on from there. "race" and "robust" drive laps
each 819,200 steps: then policy.npz is the last policy that was clean, if there was one.

The algorithm is PPO (Schulman et al., arXiv:1707.06347) with generalised advantages (Schulman et al.,
arXiv:1506.02438); that of "overtake" is DAgger (Ross et al., arXiv:1011.0686).
"""

import time

START = time.monotonic()  # the only clock: the imports below count, too

import argparse
import csv
import re
import runpy
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import optax
from rich.progress import BarColumn, Progress, TextColumn

import autodrive
from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.task import Observation
from autodrive.experiments.policies import Policy, PolicyMemory
from autodrive.experiments.policies.policy import OUTPUTS, PolicyDrivers
from autodrive.experiments.policies.racer import INPUTS, drive_laps
from autodrive.recording.plot import HEIGHT, Curves, panel, write_panels

ENVS, HORIZON = 64, 128
EPOCHS, MINIBATCHES = 4, 8
TRACE, CLIP = 0.95, 0.2
WIDTH = 128
CHECK_INTERVAL = 60.0  # between two checkpoints [s]
TRY_INTERVAL = 3.0  # between two tries with --until-clean [s]
TRY_STEPS = 100 * ENVS * HORIZON  # between two tries else: so the same seed keeps the same policy
ALONE = "race", "robust"  # problems whose policy drives laps on the shipped tracks
TRIALS = "technical", "practice", "fast"  # tracks of a try, the most difficult one first
LAPS = 10  # of a try, on each track
GAP, PAST = "gap", "past"  # rivals: the example of a race, and the policy of some updates ago; others are policies
FOLLOW_THE_GAP = Path(__file__).parents[1] / "racing" / "follow_the_gap.py"
CALM = -1.7  # logarithm of the standard deviation of the actions of a careful car
RENEWAL = 50  # updates after which the policy of then becomes the rival of the past
ONLY_VALUES = 20  # updates that learn the values only, if a policy was the beginning
TOP_SPEED = 25.252  # of throttle 1 [m/s]
LENGTH, DISTANCE, SIDE = 0.5, 0.5, 0.42  # of the car, behind a rival, and from its centre to the side [m]
BRAKING = 1.5  # towards a rival [m/s^2]
SEEN, NEAR = 4.0, 2.5  # rivals ahead, and around, that matter [m]
SURPLUS, SWERVE = 1.5, 0.45  # speed beyond that of a rival [m/s] from which it steers that much to the other side
LESSONS, LESSON_BATCHES, LESSON_BATCH = 300_000, 48, 1024  # kept; of each improvement, and in each of them
FAR_LESSONS = 0.4  # part of those without a rival near that is kept
SCALES = {"speed": 0.2, "wheel_speed": 0.2, "yaw_rate": 0.3, "steering": 2.0, "range": 0.2}
"""Factors of features, which become about -1 to 1; the others stay."""


MOTION, RANGES = INPUTS[:3], INPUTS[3:]  # what a script may read in a race


def earlier(names: tuple[str, ...], *ago: int) -> list[str]:
    """These numbers as they were so many steps ago."""
    return [f"{name}@{k}" for k in ago for name in names]


@dataclass(frozen=True)
class Problem:
    """What is learnt."""

    env: str
    observation: Observation
    inputs: tuple[str, ...] | None  # what the policy reads (autodrive.experiments.policies); None: all features of now
    throttle: tuple[float, float]  # range of the output
    discount: float
    reward: float  # factor that brings the values to about 1
    settings: dict[str, Any] = field(default_factory=dict)
    crash: float = 0.0  # what a collision of a careful car costs beyond the reward of the environment [m]
    careful: int = 0  # steps after which cars are careful; then the actions also deviate less from their mean
    ends_alone: bool = False  # whether the episodes of the cars of a world end one by one
    first_throttle: float = 0.0  # at the start, as output of the network: -1 to 1
    deviation: float = -1.5  # logarithm of the standard deviation of the actions, if a policy is the beginning
    rate: float = 5e-4  # of the learning at the start
    value_rate: float = 1.0  # factor of the rate for the values
    decay: int = 6000  # updates until the rate is a tenth
    rivals: Mapping[str, int] = field(default_factory=dict[str, int])  # of the first car, and in how many worlds


RACE = Problem(
    env="autodrive:RoboRacer-v0",
    observation="lidar",
    inputs=(*INPUTS, *earlier(RANGES, 3), *earlier(MOTION, 1, 2, 3, 5, 8), *earlier(OUTPUTS, 1, 2, 3, 4, 6)),
    throttle=(0.7 / TOP_SPEED, 9.2 / TOP_SPEED),  # 0.7 to 9.2 m/s: it cannot stand still
    discount=0.99,
    reward=0.2,
    settings={
        "tracks": 32,
        "track_width": (0.9, 1.4),
        "track_length": (58.0, 70.0),
        "track_radius": (0.75, 0.9),
        "noise": 1.0,
        "friction": (0.8, 1.2),
        "mass": (0.8, 1.2),
        "latency": (0.0, 0.04),
    },
    crash=95.0,
    careful=1_500_000,
    first_throttle=-0.7,  # 2 m/s: cars that are slow at first learn to steer four times as soon
    decay=800,
)
HARDER = {
    "tracks": 64,
    "track_seed": 200,
    "track_width": (0.9, 1.5),
    "track_length": (60.0, 112.0),
    "track_radius": (0.8, 1.4),
    "track_area": (30.0, 10.0),
    "noise": (0.0, 2.0),
    "friction": (0.7, 1.35),
    "mass": (0.75, 1.25),
    "latency": (0.0, 0.06),
}
DUEL = replace(
    RACE,
    discount=0.995,
    settings={
        **RACE.settings,
        "tracks": 48,
        "track_seed": 200,
        "track_width": (1.3, 1.5),
        "track_length": 40.0,
        "track_radius": 1.4,
        "noise": (0.5, 1.5),
        "friction": (0.95, 1.05),
        "mass": (0.95, 1.05),
        "latency": (0.0, 0.01),
        "cars": 2,
        "rivalry": 1.0,
        "max_episode_steps": 400,  # 10 s: most is decided soon after the start
    },
    crash=60.0,
    careful=0,
    deviation=-1.8,
    rate=1.5e-4,
    value_rate=4.0,
    decay=60000,
    rivals={"race": 22, "gap": 2, "past": 4},
)
PROBLEMS = {
    "race": RACE,
    "robust": replace(
        RACE, settings={**RACE.settings, **HARDER}, crash=120.0, careful=0, deviation=-2.0, rate=2e-4, decay=2000
    ),
    "duel": DUEL,
    "overtake": replace(
        DUEL,
        settings={**DUEL.settings, "max_episode_steps": 900},
        rate=1e-3,
        decay=12000,
        rivals={"race": 22, "gap": 6},
    ),
    "crossing": Problem(
        "autodrive:NigelCrossing-v0",
        "state",
        None,
        (0.0, 1.0),
        discount=0.997,  # 17 s: to wait costs little
        reward=1.0,
        ends_alone=True,
        careful=1_300_000,
    ),
    "lane": Problem("autodrive:NigelLaneKeeping-v0", "state", None, (0.0, 1.0), discount=0.98, reward=3.0),
}


def optimizer(problem: Problem) -> optax.GradientTransformation:
    """Adam, whose rate falls to a tenth."""
    rate = optax.linear_schedule(problem.rate, 0.1 * problem.rate, problem.decay)
    of_values = optax.masked(optax.scale(problem.value_rate), _is_of_critic)
    return optax.chain(optax.clip_by_global_norm(0.5), optax.adam(rate, eps=1e-5), of_values)


class Agent(eqx.Module):
    """The mean of the action, its standard deviation, and the value of an observation."""

    actor: eqx.nn.MLP
    critic: eqx.nn.MLP
    log_std: jax.Array

    def __init__(self, inputs: int, throttle: float, key: jax.Array) -> None:
        first, second = jax.random.split(key)
        actor = eqx.nn.MLP(inputs, 2, WIDTH, 2, jnp.tanh, key=first)
        last = 0.01 * actor.layers[-1].weight, jnp.array([throttle, 0.0], jnp.float32)  # hardly depends on the inputs
        self.actor = eqx.tree_at(lambda one: (one.layers[-1].weight, one.layers[-1].bias), actor, last)
        self.critic = eqx.nn.MLP(inputs, "scalar", WIDTH, 2, jnp.tanh, key=second)
        self.log_std = jnp.full(2, -0.7, jnp.float32)  # with a weak type `learn` compiles twice


class Rollout(NamedTuple):
    """What happened to all cars; each of shape (HORIZON, ENVS, ...)."""

    observation: Any
    action: Any
    log_prob: Any
    value: Any
    reward: Any
    has_ended: Any
    is_live: Any  # whether the car's episode went on: only this is learnt from


def log_prob(agent: Agent, mean: jax.Array, action: jax.Array) -> jax.Array:
    """Of actions, by the normal distribution."""
    deviation = (action - mean) / jnp.exp(agent.log_std)
    return jnp.sum(-0.5 * deviation**2 - agent.log_std - 0.5 * jnp.log(2.0 * jnp.pi), axis=-1)


@eqx.filter_jit
def decide(agent: Agent, observation: jax.Array, key: jax.Array) -> tuple[jax.Array, ...]:
    """Actions, their probabilities, and values, for observations of shape (n, n_input), and the next key."""
    following, key = jax.random.split(key)
    mean = jax.vmap(agent.actor)(observation)
    action = mean + jnp.exp(agent.log_std) * jax.random.normal(key, mean.shape)
    return action, log_prob(agent, mean, action), jax.vmap(agent.critic)(observation), following


@eqx.filter_jit
def values(agent: Agent, observation: jax.Array) -> jax.Array:
    """Of observations of shape (n, n_input)."""
    return jax.vmap(agent.critic)(observation)


def advantages(rollout: Rollout, last_value: jax.Array, discount: float) -> jax.Array:
    """Generalised advantages, backwards in time."""

    def step(carry, now):
        later, next_value = carry
        reward, value, has_ended = now
        goes_on = 1.0 - has_ended
        later = reward + discount * goes_on * next_value - value + discount * TRACE * goes_on * later
        return (later, value), later

    start = jnp.zeros_like(last_value), last_value
    return jax.lax.scan(step, start, (rollout.reward, rollout.value, rollout.has_ended), reverse=True)[1]


def loss(agent: Agent, batch: tuple[Rollout, jax.Array, jax.Array], share: jax.Array) -> jax.Array:
    """Clipped surrogate, of which this share counts, and squared error of the value."""
    rollout, advantage, target = batch
    live = rollout.is_live
    count = jnp.maximum(live.sum(), 1.0)
    mean = (live * advantage).sum() / count
    advantage = (advantage - mean) / (jnp.sqrt((live * (advantage - mean) ** 2).sum() / count) + 1e-8)
    ratio = jnp.exp(log_prob(agent, jax.vmap(agent.actor)(rollout.observation), rollout.action) - rollout.log_prob)
    surrogate = jnp.minimum(ratio * advantage, jnp.clip(ratio, 1.0 - CLIP, 1.0 + CLIP) * advantage)
    error = jax.vmap(agent.critic)(rollout.observation) - target
    return jnp.sum(live * (-share * surrogate + 0.5 * error**2)) / count


@eqx.filter_jit
def learn(agent, memory, rollout, last_value, discount, share, optimizer, key) -> tuple[Any, Any]:
    """Improve the agent by a rollout; `memory` is that of the optimizer, `share`: see `loss`."""
    advantage = advantages(rollout, last_value, discount)
    data = jax.tree.map(lambda one: one.reshape(-1, *one.shape[2:]), (rollout, advantage, advantage + rollout.value))
    weights, rest = eqx.partition(agent, eqx.is_inexact_array)

    def update(carry, places):
        weights, memory = carry
        batch = jax.tree.map(lambda one: one[places], data)
        gradient = jax.grad(lambda these: loss(eqx.combine(these, rest), batch, share))(weights)
        changes, memory = optimizer.update(gradient, memory, weights)
        return (optax.apply_updates(weights, changes), memory), None

    keys = jax.random.split(key, EPOCHS)
    orders = jax.vmap(lambda one: jax.random.permutation(one, ENVS * HORIZON))(keys).reshape(EPOCHS * MINIBATCHES, -1)
    (weights, memory), _ = jax.lax.scan(update, (weights, memory), orders)
    return eqx.combine(weights, rest), memory


class Rivals:
    """Drivers that do not learn; each drives the second car in some worlds."""

    def __init__(self, problem: Problem, readings: list[str], envs: Any) -> None:
        """`readings`: names of the numbers of an observation."""
        self.is_learner = np.ones(ENVS, np.bool_)
        self._readings, self._envs = readings, envs
        self._rows: dict[str, np.ndarray] = {}
        self._policies: dict[str, PolicyDrivers] = {}
        for name, count in problem.rivals.items():
            first = 1 + 2 * sum(map(len, self._rows.values()))
            self._rows[name] = np.arange(first, first + 2 * count, 2)
            self.is_learner[self._rows[name]] = False
            if name == GAP:
                self._gap = runpy.run_path(str(FOLLOW_THE_GAP))["command"]
            elif name != PAST:
                self.use(name, Policy.find(name))

    def use(self, name: str, policy: Policy) -> None:
        """Let a policy drive in the worlds of that name."""
        if name in self._rows:
            self._policies[name] = PolicyDrivers(policy, self._readings, len(self._rows[name]))

    def add(self, observation: np.ndarray) -> None:
        """What all cars see one step later."""
        for name, drivers in self._policies.items():
            drivers.add(observation[self._rows[name]])

    def begin(self, observation: np.ndarray, cars: np.ndarray) -> None:
        """The episodes of some cars begin; `observation`: of all of them."""
        for name, drivers in self._policies.items():
            rows = self._rows[name][cars[self._rows[name]]]
            drivers.begin_episodes(observation[rows], cars[self._rows[name]])

    def drive(self, commands: np.ndarray) -> None:
        """Write their commands."""
        for name, drivers in self._policies.items():
            commands[self._rows[name]] = drivers.commands()
        if GAP in self._rows:
            scans = self._envs.batch.readings.lidar_ranges.reshape(ENVS, -1)
            angles = np.radians(np.linspace(-135.0, 135.0, scans.shape[1]))
            commands[self._rows[GAP]] = [self._gap(scan, angles) for scan in scans[self._rows[GAP]]]


class Trainer:
    """The environments and the agent of one training."""

    def __init__(self, name: str, seed: int) -> None:
        self.name, self.problem, self.seed = name, PROBLEMS[name], seed
        self.envs: Any = gymnasium.make_vec(
            self.problem.env,
            num_envs=ENVS,
            vectorization_mode="vector_entry_point",
            autoreset_mode="SameStep",
            **({} if self.problem.ends_alone else {"observation": self.problem.observation}),
            **self.problem.settings,
        )
        names = [one.name for one in observed(self.envs.task, self.problem.observation)]
        self.inputs = self.problem.inputs or tuple(names)
        self.past = PolicyMemory(self.inputs, names, ENVS)
        kinds = [re.sub(r"_[-\d.]+$", "", one.partition("@")[0]) for one in self.inputs]  # range_-45@2: range
        self.scale = np.array([SCALES.get(kind, 1.0) for kind in kinds])
        self.key, key = jax.random.split(jax.random.PRNGKey(seed))
        self.steps, self.seconds = 0, 0.0
        self.agent: Agent = Agent(len(self.inputs), self.problem.first_throttle, key)
        self.optimizer = optimizer(self.problem)
        self.memory = self.optimizer.init(eqx.filter(self.agent, eqx.is_inexact_array))
        self.rivals = Rivals(self.problem, names, self.envs)
        self.rivals.use(PAST, self.policy())
        self.only_values = 0  # rollouts from which only the values are learnt
        self.is_kept = False  # whether the policy in the output folder is a kept one
        self.returns: list[float] = []
        self._sums = np.zeros(ENVS)
        self._seen: jax.Array | None = None

    def read(self) -> jax.Array:
        """What the policies of all cars read now."""
        return jnp.asarray(self.past.inputs * self.scale, jnp.float32)

    def command(self, action: jax.Array) -> np.ndarray:
        """Throttle and steering of actions; those beyond -1 to 1 count as these."""
        outputs = np.clip(np.asarray(action), -1.0, 1.0)
        self.past.put_out(outputs)
        low, high = self.problem.throttle
        return np.column_stack([low + (high - low) * 0.5 * (outputs[:, 0] + 1.0), outputs[:, 1]])

    def rollout(self) -> tuple[Rollout, jax.Array]:
        """Drive for HORIZON steps. Returns what happened, and the values of the last observations."""
        rows = []
        seen = self.seen()
        for _ in range(HORIZON):
            action, probability, value, self.key = decide(self.agent, seen, self.key)
            was_live = self.envs.is_live.copy() if self.problem.ends_alone else self.rivals.is_learner
            reward, terminated, truncated, last = self.drive(action)
            is_over = terminated | truncated
            has_ended = was_live & (is_over | ~self.envs.is_live) if self.problem.ends_alone else is_over
            self._sums += reward
            if self.steps >= self.problem.careful:
                reward = reward - self.problem.crash * (terminated & has_ended)
            reward = self.problem.reward * reward
            if truncated.any():  # it would have gone on: the value of what came last stands for the rest
                reward[truncated] += self.problem.discount * np.asarray(values(self.agent, last))[truncated]
            self.returns += self._sums[has_ended & self.rivals.is_learner].tolist()
            self._sums[has_ended] = 0.0
            rows.append(Rollout(seen, action, probability, value, *map(np.float32, (reward, has_ended, was_live))))
            seen = self.seen()
        self.steps += ENVS * HORIZON
        return Rollout(*map(np.stack, zip(*rows, strict=True))), values(self.agent, seen)

    def seen(self) -> jax.Array:
        """What the policies of all cars read now; at first all episodes begin."""
        if self._seen is None:
            observation, _ = self.envs.reset(seed=1_000_003 * self.seed + self.steps)
            self.past.begin(observation)
            self.rivals.begin(observation, np.ones(ENVS, np.bool_))
            self._seen = self.read()
            cars = self.envs.car_count
            self.envs.steps[:] = np.random.default_rng(self.seed).integers(0, 1000, ENVS // cars).repeat(cars)
        return self._seen

    def drive(self, action: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, jax.Array]:
        """One step of all cars. Returns rewards, which episodes ended and which were truncated, and what was read.

        That is at the end of these episodes: the next ones have begun then.
        """
        commands = self.command(action)
        self.rivals.drive(commands)
        observation, reward, terminated, truncated, info = self.envs.step(commands)
        is_over = terminated | truncated
        begun = observation.copy()
        if is_over.any():
            observation[is_over] = np.stack(info["final_obs"][is_over])
        self.past.add(observation)
        self.rivals.add(observation)
        last = self.read()
        self.past.begin(begun[is_over], is_over)
        self.rivals.begin(begun, is_over)
        self._seen = self.read() if is_over.any() else last
        return reward, terminated, truncated, last

    def improve(self) -> None:
        """One rollout, and what is learnt from it."""
        rollout, last_value = self.rollout()
        self.key, key = jax.random.split(self.key)
        if self.steps - ENVS * HORIZON < self.problem.careful <= self.steps:
            self.agent = eqx.tree_at(lambda agent: agent.log_std, self.agent, jnp.full(2, CALM, jnp.float32))
        share = jnp.asarray(float(self.only_values <= 0))
        self.only_values -= 1
        self.agent, self.memory = learn(
            self.agent, self.memory, rollout, last_value, self.problem.discount, share, self.optimizer, key
        )
        if self.steps % (RENEWAL * ENVS * HORIZON) == 0:
            self.rivals.use(PAST, self.policy())

    def policy(self, **about: Any) -> Policy:
        """The mean of the actions as a file that needs no JAX; `about`: more about its training."""
        layers = tuple((np.asarray(one.weight), np.asarray(one.bias)) for one in self.agent.actor.layers)
        training = {"command": " ".join(sys.argv), "seed": self.seed, "steps": self.steps}
        training |= {"autodrive": autodrive.__version__, "jax": jax.__version__, **about}
        return Policy(
            self.envs.task.name,
            self.inputs,
            tuple(self.scale.tolist()),
            self.problem.throttle,
            layers,
            training,
        )

    def save(self, folder: Path) -> None:
        """Write the checkpoint, and the policy if none was kept."""
        eqx.tree_serialise_leaves(folder / "checkpoint.eqx", self._learnt())
        if not self.is_kept:
            self.policy().save(folder / "policy.npz")

    def keep(self, folder: Path) -> None:
        """Write the policy, which drives clean laps: only such a one replaces it."""
        self.policy(clean_laps=LAPS).save(folder / "policy.npz")
        self.is_kept = True

    def resume(self, folder: Path) -> None:
        """Go on from a checkpoint; all cars begin a new episode."""
        before = Policy.load(folder / "policy.npz")
        self._drive_like(before)
        self.is_kept = "clean_laps" in before.training
        learnt = eqx.tree_deserialise_leaves(folder / "checkpoint.eqx", self._learnt())
        self.agent, self.memory, self.key, self.steps, self.seconds = learnt

    def begin_with(self, source: str, factor: float = 1.0) -> None:
        """Take the networks of another training that reads the same, or a policy; then values are learnt first.

        `factor`: by which the policy is made slower, see `Policy.slower`.
        """
        if (folder := Path(source)).is_dir():
            self._drive_like(Policy.load(folder / "policy.npz"))
            self.agent = eqx.tree_deserialise_leaves(folder / "checkpoint.eqx", self._learnt())[0]
            return
        policy = Policy.find(source).slower(factor)
        self._drive_like(policy)
        places = [self.inputs.index(name) for name in policy.inputs]
        (weight, bias), *rest = policy.layers
        wide = np.zeros((len(weight), len(self.inputs)), np.float32)
        wide[:, places] = weight * np.array(policy.scale) / self.scale[places]
        given = [one for layer in ((wide, bias), *rest) for one in layer] + [
            np.full(2, self.problem.deviation, np.float32)
        ]
        self.agent = eqx.tree_at(_of_actor, self.agent, [jnp.asarray(one) for one in given])
        self.only_values = ONLY_VALUES
        self.rivals.use(PAST, self.policy())

    def _drive_like(self, policy: Policy) -> None:
        """Let outputs mean what they do for this policy: it may read those of the last steps."""
        self.problem = replace(self.problem, throttle=policy.throttle)

    def _learnt(self):
        return self.agent, self.memory, self.key, self.steps, self.seconds


class Overtaker(Trainer):
    """Learns to do, by what it reads, what the driver of the beginning does if `guarded` knows where the rival is.

    It drives itself, so that it learns where its own mistakes lead (DAgger: Ross et al., arXiv:1011.0686).
    """

    def __init__(self, name: str, seed: int) -> None:
        super().__init__(name, seed)
        self.teacher = self.agent.actor
        self._rng = np.random.default_rng(seed)
        self.lessons = [np.zeros((LESSONS, width), np.float32) for width in (len(self.inputs), 2, 1)]
        self.lesson_count = 0

    def begin_with(self, source: str, factor: float = 1.0) -> None:
        """See `Trainer.begin_with`; that driver is the teacher."""
        super().begin_with(source, factor)
        self.teacher = self.agent.actor

    def improve(self) -> None:
        """Drive for HORIZON steps, and learn from some of the last lessons."""
        for _ in range(HORIZON):
            read = self.seen()
            lesson, weight, is_near = self.lesson(read)
            rows = np.flatnonzero(self.rivals.is_learner & (is_near | (self._rng.random(ENVS) < FAR_LESSONS)))
            places = np.arange(self.lesson_count, self.lesson_count + len(rows)) % LESSONS
            for kept, new in zip(self.lessons, (np.asarray(read), lesson, weight[:, None]), strict=True):
                kept[places] = new[rows]
            self.lesson_count += len(rows)
            action = _act(self.agent.actor, read) + 0.05 * self._rng.normal(size=(ENVS, 2))
            reward, terminated, truncated, _ = self.drive(action)
            self._sums += reward
            has_ended = self.rivals.is_learner & (terminated | truncated)
            self.returns += self._sums[has_ended].tolist()
            self._sums[terminated | truncated] = 0.0
        self.steps += ENVS * HORIZON
        chosen = self._rng.integers(0, min(self.lesson_count, LESSONS), (LESSON_BATCHES, LESSON_BATCH))
        batches = [jnp.asarray(kept[chosen]) for kept in self.lessons]
        self.agent, self.memory = imitate(self.agent, self.memory, batches, self.optimizer)

    def lesson(self, read: jax.Array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs of the guarded teacher, shape (n, 2), their weights, and whether a rival is near, each (n,)."""
        (low, high), outputs = self.problem.throttle, _act(self.teacher, read)
        wish = low + (high - low) * 0.5 * (outputs[:, 0] + 1.0)
        throttle, swerve, is_near = guarded(wish, self.envs.batch.readings)
        slow = np.maximum(2.0 * (throttle - low) / (high - low) - 1.0, -1.2)
        drive = np.where(throttle < wish, slow, outputs[:, 0])
        steer = np.where(swerve != 0.0, np.clip(outputs[:, 1] + swerve, -1.0, 1.0), outputs[:, 1])
        weight = np.where(throttle < wish, 2.0, 1.0) * np.where(is_near, 1.5, 1.0)
        return np.column_stack([drive, steer]), weight, is_near


def guarded(wish: np.ndarray, cars: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Throttle and additional steering of cars that race in pairs, and whether the rival is near.

    `wish`: throttle without a rival, shape (n,); `cars`: readings of the batch. Behind a rival the car is so fast that
    it can brake to the speed of the rival before `DISTANCE`. If it could be faster by `SURPLUS`, it steers beside it.
    """
    place, velocity = (one.reshape(-1, 2, 3)[..., :2] for one in (cars.position, cars.velocity))
    turn = cars.orientation.reshape(-1, 2, 4)
    yaw = 2.0 * np.arctan2(turn[..., 3], turn[..., 0])
    there, away = place[:, ::-1] - place, yaw[:, ::-1] - yaw
    ahead = (there[..., 0] * np.cos(yaw) + there[..., 1] * np.sin(yaw)).ravel()
    left = (there[..., 1] * np.cos(yaw) - there[..., 0] * np.sin(yaw)).ravel()
    other = velocity[:, ::-1]
    pace = (other[..., 0] * np.cos(away) - other[..., 1] * np.sin(away)).ravel()  # of the rival, along this car
    is_behind = (np.abs(left) < SIDE + 0.2 * np.abs(np.sin(away.ravel()))) & (ahead > 0.0) & (ahead < SEEN)
    room = ahead - LENGTH - DISTANCE
    speed = pace + np.where(room > 0.0, np.sqrt(2.0 * BRAKING * np.maximum(room, 0.0)), 4.0 * room)
    throttle = np.where(is_behind, np.minimum(wish, np.maximum(speed, 0.3) / TOP_SPEED), wish)
    may_pass = is_behind & (ahead < LENGTH + 1.0) & (wish * TOP_SPEED - pace > SURPLUS)
    swerve = np.where(may_pass, np.where(left > 0.0, -SWERVE, SWERVE), 0.0)
    is_near = (np.abs(ahead) < NEAR) & (np.abs(left) < NEAR)
    return throttle, swerve, is_near


@eqx.filter_jit
def _act(actor: eqx.nn.MLP, read: jax.Array) -> Any:
    return jax.vmap(actor)(read)


@eqx.filter_jit
def imitate(agent, memory, batches, optimizer) -> tuple[Any, Any]:
    """Improve the actor by lessons: what was read, outputs, and weights."""
    weights, rest = eqx.partition(agent, eqx.is_inexact_array)

    def error(these: Any, read: jax.Array, lesson: jax.Array, weight: jax.Array) -> jax.Array:
        return jnp.mean(weight * (jax.vmap(eqx.combine(these, rest).actor)(read) - lesson) ** 2)

    def update(carry, batch):
        weights, memory = carry
        changes, memory = optimizer.update(jax.grad(error)(weights, *batch), memory, weights)
        return (optax.apply_updates(weights, changes), memory), None

    (weights, memory), _ = jax.lax.scan(update, (weights, memory), batches)
    return eqx.combine(weights, rest), memory


def _is_of_critic(tree: Agent) -> Any:
    """Of each array, whether it decides about the values."""
    no = jax.tree.map(lambda _: False, tree)
    return eqx.tree_at(lambda one: one.critic, no, jax.tree.map(lambda _: True, tree.critic))


def _of_actor(agent: Agent) -> list[Any]:
    """All that decides about the actions."""
    return [one for layer in agent.actor.layers for one in (layer.weight, layer.bias)] + [agent.log_std]


def draw_curve(folder: Path) -> None:
    """The mean return over the time of the training, as a picture."""
    rows = (folder / "curve.csv").read_text(encoding="utf-8").splitlines()[1:]
    if not rows:  # it was stopped before
        return
    _, seconds, mean = np.array([row.split(",") for row in rows], float).T
    curves = Curves("mean return of the last 100 episodes", seconds, [mean], ["PPO"])
    write_panels(folder / "curve.svg", [panel(curves, 0.0, 0.0, float(seconds[-1]))], HEIGHT)


def is_clean(policy: Policy) -> bool:
    """Whether the policy drives ten laps without a collision on each track of `TRIALS`, none of which is trained on.

    The first track on which it does not is the last that it drives on.
    """
    for track in TRIALS:
        trial = drive_laps(policy, track)
        best = f"best {trial.best_lap:.2f} s" if trial.laps else ""
        print(f"  {track}: {len(trial.laps)} laps, {trial.collisions} collisions {best}")
        if len(trial.laps) < LAPS or trial.collisions:
            return False
    return True


def main() -> None:
    """Train, and write the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("problem", choices=PROBLEMS)
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    parser.add_argument("--minutes", type=float, default=15.0, help="wall time after which training ends")
    parser.add_argument("--steps", type=int, default=10**9, help="steps of all cars after which training ends")
    parser.add_argument("--output", type=Path, default=Path("runs/race"), help="folder of the results")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in that folder")
    parser.add_argument("--begin-with", help="folder of another training, or a policy, that is improved")
    parser.add_argument("--slower", type=float, default=1.0, help="factor by which that policy is made slower")
    parser.add_argument("--until-clean", action="store_true", help="end when it drives ten clean laps on all tracks")
    options = parser.parse_args()
    if options.until_clean and options.problem not in ALONE:
        parser.error("--until-clean is for the problems 'race' and 'robust': the others have no laps")
    if options.slower != 1.0 and (not options.begin_with or Path(options.begin_with).is_dir()):
        parser.error("--slower is for a policy that is the beginning: --begin-with POLICY")
    if options.problem == "overtake" and not options.begin_with:
        parser.error("'overtake' improves a driver: give it with --begin-with, for example runs/duel")
    options.output.mkdir(parents=True, exist_ok=True)
    trainer = (Overtaker if options.problem == "overtake" else Trainer)(options.problem, options.seed)
    if options.begin_with:
        trainer.begin_with(options.begin_with, options.slower)
    if options.resume:
        trainer.resume(options.output)
    start = START - trainer.seconds
    checked = tried = trainer.seconds  # when the last checkpoint was written, when laps were driven
    driven = trainer.steps  # laps after so many steps
    is_stopped = False
    columns = [TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.1f} of {task.total:g} min")]
    with (options.output / "curve.csv").open("a" if options.resume else "w") as file, Progress(*columns) as progress:
        curve, bar = csv.writer(file), progress.add_task("compiling", total=options.minutes)
        if not options.resume:
            curve.writerow(["steps", "seconds", "mean_return"])
        try:
            is_over = False
            while not is_over:
                trainer.improve()
                trainer.seconds = time.monotonic() - start
                mean = float(np.mean(trainer.returns[-100:] or [0.0]))
                curve.writerow([trainer.steps, round(trainer.seconds, 1), round(mean, 3)])
                rate = trainer.steps / trainer.seconds
                text = f"{trainer.steps} steps, {rate:.0f} steps/s, mean return {mean:.2f}"
                progress.update(bar, completed=trainer.seconds / 60.0, description=text)
                is_due = trainer.seconds - tried > TRY_INTERVAL
                if not options.until_clean:
                    is_due = trainer.steps - driven >= TRY_STEPS
                if options.problem in ALONE and is_due:
                    tried, driven = trainer.seconds, trainer.steps
                    if is_clean(trainer.policy()):
                        trainer.keep(options.output)
                        if options.until_clean:
                            minutes = (time.monotonic() - start) / 60.0
                            print(f"clean laps on all tracks after {minutes:.1f} min, {trainer.steps} steps")
                            break
                if trainer.seconds - checked > CHECK_INTERVAL:
                    checked = trainer.seconds
                    trainer.save(options.output)
                    file.flush()
                is_over = time.monotonic() - start >= 60.0 * options.minutes or trainer.steps >= options.steps
        except KeyboardInterrupt:
            print("stopped; --resume goes on")
            is_stopped = True
    trainer.save(options.output)
    draw_curve(options.output)
    if options.problem in ALONE and not is_stopped and driven != trainer.steps and is_clean(trainer.policy()):
        trainer.keep(options.output)


if __name__ == "__main__":
    main()
