"""A policy: a network from numbers that a car senses to throttle and steering, in NumPy.

A policy may read the last moments: the input `yaw_rate@2` is the reading `yaw_rate` two steps ago, and `drive@1` and
`steer@1` are its own outputs one step ago, -1 to 1. `PolicyMemory` keeps them.

A policy may have a second network, its `Pace`, which estimates from the motion of the car how much slower the policy
must drive than it was trained to: with little grip, with latency. It also limits the throttle.

A file of a policy is an .npz archive (`numpy.savez`): the arrays `weight_0`, `bias_0`, `weight_1` ... of the layers,
and `about`, JSON with the other attributes of `Policy`. With a pace its format is 2: there are also `pace_weight_0`,
`pace_bias_0` ..., and `about` has the other attributes of `Pace` under "pace".
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.elementary import exp
from autodrive.base.errors import AutodriveError, SpecError
from autodrive.base.jit import jit
from autodrive.base.readable import readable
from autodrive.base.suggest import suggest

PLAIN, WITH_PACE = 1, 2
"""Formats of a file."""
DATA = Path(__file__).with_name("data")
MOST_BYTES = 2**26
"""Largest file that is read; a policy has some 100 kB."""

OUTPUTS = "drive", "steer"
"""Names of a policy's own outputs, which it may read as they were one step ago or more."""
OWN = *OUTPUTS, "throttle"
"""Inputs of a pace that are outputs of the policy, -1 to 1: those of `OUTPUTS`, and the throttle that it commanded."""
SPEEDS = "speed", "side_speed", "wheel_speed", "yaw_rate"
"""Features that are speeds."""
PACE = "pace_"
"""Beginning of the names of the arrays of a pace."""
PACE_NUMBERS = "inputs", "scale", "slowness", "keep", "top_throttle"
"""Attributes of a pace that are numbers or names."""
GREATEST = 1e6
"""Greatest magnitude of scales, weights and biases: no sum of products of such numbers overflows."""
GREATEST_THROTTLE = 10.0
"""Greatest magnitude of the throttle of an output; a car gets 1 at most."""
LONGEST = 100
"""Steps ago of the oldest moment that a policy may read."""

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass(frozen=True)
class Pace:
    """A network that estimates how much slower a policy must drive, and how sure that is, from the last moments.

    Its outputs are a slowness and the logarithm of a weight. The estimate is the weighted mean of the slowness in all
    steps of an episode, of which older ones count less; it begins with the greatest slowness and the weight 1. Raises
    `AutodriveError` for shapes and numbers that do not fit.
    """

    inputs: tuple[str, ...]
    """Names of the inputs, as in `Policy`; own outputs may be `throttle`, too."""
    scale: tuple[float, ...]
    """Factor of each input."""
    slowness: tuple[float, float]
    """The least and the greatest one that is used; see `Policy.slower`."""
    keep: float
    """Factor by which the weights of the past get less in each step, 0 to 1."""
    layers: tuple[Layer, ...]
    """Layers of the network, as in `Policy`."""
    top_throttle: float = 1.0
    """The greatest one that is commanded; 1: no limit."""

    def __post_init__(self) -> None:
        _check("pace", self.inputs, self.scale, self.layers, "slowness and the logarithm of its weight")
        least, most = self.slowness
        if not 0.1 <= least <= most <= 10.0:
            raise AutodriveError(f"the slowness of a pace must be two numbers from 0.1 to 10, not {self.slowness}")
        if not 0.0 <= self.keep <= 1.0:
            raise AutodriveError(f"the factor 'keep' of a pace must be from 0 to 1, not {self.keep:g}")
        if not 0.0 < self.top_throttle <= 1.0:
            raise AutodriveError(f"the top throttle of a pace must be over 0 and at most 1, not {self.top_throttle:g}")

    def evidence(self, inputs: NDArray[Any]) -> Floats:
        """Slowness times weight, and weight, shape (n, 2), for the numbers `inputs`, shape (n, n_input)."""
        evidence = _forward(self.scale, self.layers, inputs)
        for row in evidence:
            row[1] = exp(min(max(row[1], -20.0), 20.0))
            row[0] *= row[1]
        return evidence


@dataclass(frozen=True)
class Policy:
    """A network with tanh between its layers. Raises `AutodriveError` for shapes that do not fit."""

    task: str
    """Name of the task of `autodrive.experiments.envs` that it was trained for."""
    inputs: tuple[str, ...]
    """Names of the numbers that go in, in order: features (`autodrive.experiments.envs.episodes.observed`) and own
    outputs, of now or, with `@k`, of k steps ago."""
    scale: tuple[float, ...]
    """Factor of each input."""
    throttle: tuple[float, float]
    """Throttle of the output -1 and of the output 1."""
    layers: tuple[Layer, ...]
    """Weight, shape (n_out, n_in), and bias, shape (n_out,), of each layer; the last one has two outputs."""
    training: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """How it was made: command, seed, versions, steps."""

    pace: Pace | None = None
    """The pace by which it drives slower than this network does; None: it never does."""

    def __post_init__(self) -> None:
        _check("policy", self.inputs, self.scale, self.layers, "throttle and steering")
        if not all(abs(limit) <= GREATEST_THROTTLE for limit in self.throttle):
            low, high = self.throttle
            raise AutodriveError(
                f"the throttle of a policy must be two numbers from -{GREATEST_THROTTLE:g} to {GREATEST_THROTTLE:g}, "
                f"not {low:g} and {high:g}"
            )

    @property
    def readings(self) -> tuple[str, ...]:
        """Names of the features that it and its pace read, now or earlier."""
        inputs = *self.inputs, *(self.pace.inputs if self.pace else ())
        return tuple(dict.fromkeys(name for name, _ in moments(inputs) if name not in OWN))

    @cached_property
    def is_speed(self) -> NDArray[np.bool_]:
        """Whether each input is a speed, shape (n_input,)."""
        return np.array([name in SPEEDS for name, _ in moments(self.inputs)])

    def outputs(self, inputs: NDArray[Any]) -> Floats:
        """Drive and steer, -1 to 1, shape (..., 2), for the numbers `inputs`, shape (..., n_input).

        The bits are the same on every processor.
        """
        values = np.asarray(inputs, np.float64).reshape(-1, len(self.inputs))
        outputs = np.clip(_forward(self.scale, self.layers, values), -1.0, 1.0)
        return outputs.reshape(*np.shape(inputs)[:-1], 2)

    def commands(self, outputs: Floats) -> Floats:
        """Throttle and steering, shape (n, 2), for outputs of that shape."""
        low, high = self.throttle
        return np.column_stack([low + (high - low) * 0.5 * (outputs[:, 0] + 1.0), outputs[:, 1]])

    def slower(self, factor: float) -> Policy:
        """A policy that drives as this one does, with all speeds divided by `factor`.

        Where this one drives a path with the speed v, that one drives it with v / factor, so it needs 1 / factor**2 of
        the grip: what this one reads as speeds is multiplied by the factor, and its throttle divided. Raises
        `AutodriveError` if the factor is not from 0.1 to 10.
        """
        if not 0.1 <= factor <= 10.0:
            raise AutodriveError(f"the factor by which a policy is slower must be from 0.1 to 10, not {factor:g}")
        scale = tuple((np.array(self.scale) * np.where(self.is_speed, factor, 1.0)).tolist())
        low, high = self.throttle
        training = {**self.training, "slower": factor * self.training.get("slower", 1.0)}
        return replace(self, scale=scale, throttle=(low / factor, high / factor), training=training)

    def save(self, file: str | Path) -> None:
        """Write the file. Raises `AutodriveError` if that is not possible."""
        about: dict[str, Any] = {
            "format": WITH_PACE if self.pace else PLAIN,
            "task": self.task,
            "inputs": self.inputs,
            "scale": self.scale,
            "throttle": self.throttle,
            "training": dict(self.training),
        }
        arrays = _named("", self.layers)
        if self.pace:
            about["pace"] = {name: getattr(self.pace, name) for name in PACE_NUMBERS}
            arrays |= _named(PACE, self.pace.layers)
        arrays["about"] = np.array(json.dumps(about))
        data = io.BytesIO()
        np.savez(data, allow_pickle=False, **arrays)
        write_file(Path(file), data.getvalue())

    @classmethod
    def find(cls, name: str) -> Policy:
        """An included policy, given its name, or that of an .npz file, given its path. Raises `AutodriveError`."""
        included = DATA / f"{name}.npz"
        if Path(name).suffix == ".npz":
            return cls.load(Path(name))
        if included.is_file():
            return cls.load(included)
        known = sorted(path.stem for path in DATA.glob("*.npz"))
        raise SpecError([f"policy '{name[:80]}' is not known. {suggest(name, known)} Or give an .npz file"])

    @classmethod
    def load(cls, file: str | Path) -> Policy:
        """Read a file. Raises `SpecError` if it is missing or no policy."""
        try:
            arrays = _arrays(Path(file))
            about = json.loads(str(arrays["about"]))
            if about["format"] not in (PLAIN, WITH_PACE):
                raise ValueError(f"its format is {about['format']!r}; this version reads {PLAIN} and {WITH_PACE}")
            low, high = _numbers(about["throttle"])
            return cls(
                task=str(about["task"]),
                inputs=tuple(map(str, about["inputs"])),
                scale=_numbers(about["scale"]),
                throttle=(low, high),
                layers=_layers("", arrays),
                training=dict(about["training"]),
                pace=_pace(about["pace"], arrays) if about["format"] == WITH_PACE else None,
            )
        except AutodriveError as error:
            raise SpecError([f"{file}: {error}"]) from None
        except Exception as error:  # numpy, zipfile and json raise what they like for damaged files
            reason = " ".join(str(error).split()) or type(error).__name__
            raise SpecError([f"{file} is not a policy: {reason}"]) from None


class PolicyMemory:
    """What `count` cars read and what their policy put out in the last steps, as far as its inputs need it."""

    def __init__(self, inputs: tuple[str, ...], readings: Sequence[str], count: int = 1) -> None:
        """`readings`: names of the numbers given to `add` and `begin`. Raises `AutodriveError` if one is missing."""
        columns = [*readings, *OWN]
        needed = moments(inputs)
        if unknown := [name for name, _ in needed if name not in columns]:
            raise AutodriveError(f"the policy reads {unknown[0]}, which is not among its readings")
        self._columns = np.array([columns.index(name) for name, _ in needed])
        self._ago = np.array([ago for _, ago in needed])
        self._past = np.zeros((int(self._ago.max(initial=0)) + 1, count, len(columns)))

    def begin(self, readings: NDArray[Any], cars: Any = slice(None)) -> None:
        """An episode of those cars begins with these readings, shape (n, n_reading): they count for all moments."""
        self._past[:, cars, : -len(OWN)] = readings
        self._past[:, cars, -len(OWN) :] = 0.0

    def add(self, readings: NDArray[Any]) -> None:
        """The readings of all cars one step later, shape (count, n_reading)."""
        self._past[1:] = self._past[:-1].copy()
        self._past[0, :, : -len(OWN)] = readings

    def put_out(self, outputs: NDArray[Any], throttle: Any = 0.0) -> None:
        """The outputs of all cars in this step, shape (count, 2), and the throttle that follows, shape (count,)."""
        self._past[0, :, -len(OWN) : -1] = outputs
        self._past[0, :, -1] = throttle

    @property
    def inputs(self) -> Floats:
        """The inputs of all cars in this step, shape (count, n_input)."""
        return self._past[self._ago, :, self._columns].T


class PolicyDrivers:
    """A policy that drives `count` cars, and what it remembers of their episodes."""

    def __init__(self, policy: Policy, readings: Sequence[str], count: int = 1) -> None:
        """`readings`: names of the numbers given to `act`. Raises `AutodriveError` if the policy needs others."""
        self._policy = policy
        self._memory = PolicyMemory(policy.inputs, readings, count)
        self._motion = PolicyMemory(policy.pace.inputs if policy.pace else (), readings, count)
        self._evidence = np.zeros((count, 2))
        self.slowness = np.ones(count)
        """Factor by which each car drives slower than the network, shape (count,). The pace sets it, if there is
        one."""
        self.outputs = np.zeros((count, 2))
        """Outputs of the network in the last step, -1 to 1, shape (count, 2)."""
        self._has_begun = False

    def begin(self) -> None:
        """Forget everything: new episodes begin."""
        self._has_begun = False

    def begin_episodes(self, readings: NDArray[Any], cars: Any = slice(None)) -> None:
        """An episode of those cars begins with these readings, shape (n, n_reading)."""
        for memory in (self._memory, self._motion):
            memory.begin(readings, cars)
        if self._policy.pace:
            self._evidence[cars] = self._policy.pace.slowness[1], 1.0
        self._has_begun = True

    def add(self, readings: NDArray[Any]) -> None:
        """The readings of all cars one step later, shape (count, n_reading)."""
        for memory in (self._memory, self._motion):
            memory.add(readings)

    def act(self, readings: NDArray[Any]) -> Floats:
        """Throttle and steering, -1 to 1, left positive, shape (count, 2), for the readings of one more step.

        `readings`: shape (count, n_reading).
        """
        (self.add if self._has_begun else self.begin_episodes)(readings)
        return self.commands()

    def commands(self) -> Floats:
        """The commands for the readings that were added, shape (count, 2): throttle and steering, -1 to 1."""
        if pace := self._policy.pace:
            self._evidence = pace.keep * self._evidence + pace.evidence(self._motion.inputs)
            self.slowness[:] = np.clip(self._evidence[:, 0] / self._evidence[:, 1], *pace.slowness)
        inputs = self._memory.inputs
        self.outputs = self._policy.outputs(np.where(self._policy.is_speed, inputs * self.slowness[:, None], inputs))
        commands = self._policy.commands(self.outputs)
        commands[:, 0] /= self.slowness
        if pace:
            commands[:, 0] = np.minimum(commands[:, 0], pace.top_throttle)
        for memory in (self._memory, self._motion):
            memory.put_out(self.outputs, commands[:, 0])
        return commands


def moments(inputs: Sequence[str]) -> list[tuple[str, int]]:
    """Name and number of steps ago of each input. Raises `AutodriveError` if one cannot be."""
    moments_of_inputs = []
    for text in inputs:
        name, at, ago = text.partition("@")
        if at and not (ago.isdecimal() and 1 <= int(ago) <= LONGEST):
            raise AutodriveError(
                f"input '{text[:80]}' of the policy: after '@', write how many steps ago, 1 to {LONGEST}"
            )
        if name in OWN and not at:
            raise AutodriveError(
                f"input '{name}' of the policy is an output of the policy: write '{name}@1' for the output one step ago"
            )
        moments_of_inputs.append((name, int(ago) if at else 0))
    return moments_of_inputs


def _check(name: str, inputs: Sequence[str], scale: Sequence[float], layers: Sequence[Layer], outputs: str) -> None:
    """Raise `AutodriveError` unless the numbers of inputs, scales and layers fit, and there are two outputs."""
    width = len(inputs)
    if len(scale) != width:
        raise AutodriveError(f"a {name} with {width} inputs needs as many scales, not {len(scale)}")
    if not all(abs(factor) <= GREATEST for factor in scale):
        raise AutodriveError(f"the scales of a {name} must be numbers from -{GREATEST:g} to {GREATEST:g}")
    moments(inputs)
    for number, (weight, bias) in enumerate(layers):
        if weight.ndim != 2 or bias.shape != weight.shape[:1] or weight.shape[1] != width:
            raise AutodriveError(
                f"layer {number} of the {name} has a weight of shape {weight.shape} and a bias of shape "
                f"{bias.shape}; the layer has {width} inputs"
            )
        if not ((abs(weight) <= GREATEST).all() and (abs(bias) <= GREATEST).all()):
            raise AutodriveError(
                f"layer {number} of the {name} has numbers that are not from -{GREATEST:g} to {GREATEST:g}"
            )
        width = len(bias)
    if not layers or width != 2:
        raise AutodriveError(f"the last layer of a {name} has two outputs, {outputs}, not {width}")


def _forward(scale: Sequence[float], layers: Sequence[Layer], inputs: NDArray[Any]) -> Floats:
    """The outputs of a network with tanh between its layers, shape (n, 2), for inputs of the shape (n, n_input)."""
    values = inputs * np.array(scale)
    for weight, bias in layers[:-1]:
        values = _layer(weight, bias, values, is_inner=True)
    return _layer(*layers[-1], values, is_inner=False)


@jit
def _layer(weight: NDArray[np.float32], bias: NDArray[np.float32], values: Floats, is_inner: bool) -> Floats:
    """The outputs of a layer, shape (n, n_out), for values of the shape (n, n_in)."""
    outputs = np.empty((len(values), len(bias)))
    for row in range(len(values)):
        for i in range(len(bias)):
            total = float(bias[i])
            for k in range(values.shape[1]):
                total += weight[i, k] * values[row, k]
            outputs[row, i] = 1.0 - 2.0 / (exp(2.0 * total) + 1.0) if is_inner else total
    return outputs


def _named(prefix: str, layers: Sequence[Layer]) -> dict[str, NDArray[Any]]:
    """The arrays of layers, as they are called in a file."""
    parts = "weight", "bias"
    return {
        f"{prefix}{part}_{k}": array for k, layer in enumerate(layers) for part, array in zip(parts, layer, strict=True)
    }


def _layers(prefix: str, arrays: Mapping[str, NDArray[Any]]) -> tuple[Layer, ...]:
    """The layers in the arrays of a file."""
    count = sum(name.startswith(f"{prefix}weight_") for name in arrays)
    return tuple((_real(arrays[f"{prefix}weight_{k}"]), _real(arrays[f"{prefix}bias_{k}"])) for k in range(count))


def _pace(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Pace:
    least, most = _numbers(about["slowness"])
    keep, top = _numbers([about["keep"], about.get("top_throttle", 1.0)])
    inputs, scale = tuple(map(str, about["inputs"])), _numbers(about["scale"])
    return Pace(inputs, scale, (least, most), keep, _layers(PACE, arrays), top)


def _arrays(file: Path) -> dict[str, NDArray[Any]]:
    if readable(file).stat().st_size > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES} bytes")
    with zipfile.ZipFile(file) as archive:
        if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
            raise ValueError(f"its contents have more than {MOST_BYTES} bytes")
    with np.load(file, allow_pickle=False) as arrays:
        return dict(arrays)


def _real(array: NDArray[Any]) -> NDArray[np.float32]:
    if array.dtype.kind not in "fiu":
        raise ValueError(f"its layers must be real numbers, not {array.dtype}")
    with np.errstate(over="ignore"):  # infinity is refused
        return array.astype(np.float32)


def _numbers(values: Sequence[Any]) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number in it is not finite")
    return numbers
