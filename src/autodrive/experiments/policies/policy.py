"""A policy: a network from numbers that a car senses to throttle and steering, in NumPy.

A policy may read the last moments: the input `yaw_rate@2` is the reading `yaw_rate` two steps ago, and `drive@1` and
`steer@1` are its own outputs one step ago, -1 to 1. `Memory` keeps them.

A file of a policy is an .npz archive (`numpy.savez`): the arrays `weight_0`, `bias_0`, `weight_1` ... of the layers,
and `about`, JSON with the other attributes of `Policy`.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.elementary import exp
from autodrive.base.errors import AutodriveError, SpecError
from autodrive.base.jit import jit
from autodrive.base.suggest import suggest

FORMAT = 1
DATA = Path(__file__).parents[2] / "scenario" / "data" / "policies"
MOST_BYTES = 2**26
"""Largest file that is read; a policy has some 100 kB."""

OUTPUTS = "drive", "steer"
"""Names of a policy's own outputs, which it may read as they were one step ago or more."""
SPEEDS = "speed", "side_speed", "wheel_speed", "yaw_rate"
"""Features that are speeds."""
LONGEST = 100
"""Steps ago of the oldest moment that a policy may read."""

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


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

    def __post_init__(self) -> None:
        width = len(self.inputs)
        if len(self.scale) != width:
            raise AutodriveError(f"a policy with {width} inputs needs as many scales, not {len(self.scale)}")
        moments(self.inputs)
        for number, (weight, bias) in enumerate(self.layers):
            if weight.ndim != 2 or bias.shape != weight.shape[:1] or weight.shape[1] != width:
                raise AutodriveError(
                    f"layer {number} of the policy has a weight of shape {weight.shape} and a bias of shape "
                    f"{bias.shape}; {width} numbers go in"
                )
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise AutodriveError(f"layer {number} of the policy has numbers that are not finite")
            width = len(bias)
        if not self.layers or width != 2:
            raise AutodriveError(f"the last layer of a policy has two outputs, throttle and steering, not {width}")

    @property
    def readings(self) -> tuple[str, ...]:
        """Names of the features that it reads, now or earlier."""
        return tuple(dict.fromkeys(name for name, _ in moments(self.inputs) if name not in OUTPUTS))

    def outputs(self, inputs: NDArray[Any]) -> Floats:
        """Drive and steer, -1 to 1, shape (..., 2), for the numbers `inputs`, shape (..., n_input).

        The bits are the same on every processor.
        """
        values = np.asarray(inputs, np.float64).reshape(-1, len(self.inputs)) * np.array(self.scale)
        for weight, bias in self.layers[:-1]:
            values = _layer(weight, bias, values, is_inner=True)
        outputs = np.clip(_layer(*self.layers[-1], values, is_inner=False), -1.0, 1.0)
        return outputs.reshape(*np.shape(inputs)[:-1], 2)

    def slower(self, factor: float) -> Policy:
        """The same driver with all speeds divided by `factor`.

        Where this one drives a path with the speed v, that one drives it with v / factor, so it needs 1 / factor**2 of
        the grip: what this one reads as speeds is multiplied by the factor, and its throttle divided. Raises
        `AutodriveError` if the factor is not from 0.1 to 10.
        """
        if not 0.1 <= factor <= 10.0:
            raise AutodriveError(f"the factor by which a policy is slower must be from 0.1 to 10, not {factor:g}")
        speeds = [factor if name in SPEEDS else 1.0 for name, _ in moments(self.inputs)]
        scale = tuple(one * speed for one, speed in zip(self.scale, speeds, strict=True))
        low, high = self.throttle
        training = {**self.training, "slower": factor * self.training.get("slower", 1.0)}
        return replace(self, scale=scale, throttle=(low / factor, high / factor), training=training)

    def save(self, file: Path) -> None:
        """Write the file. Raises `AutodriveError` if that is not possible."""
        about = {
            "format": FORMAT,
            "task": self.task,
            "inputs": self.inputs,
            "scale": self.scale,
            "throttle": self.throttle,
            "training": dict(self.training),
        }
        arrays: dict[str, NDArray[Any]] = {"about": np.array(json.dumps(about))}
        for number, (weight, bias) in enumerate(self.layers):
            arrays |= {f"weight_{number}": weight, f"bias_{number}": bias}
        data = io.BytesIO()
        np.savez(data, allow_pickle=False, **arrays)
        write_file(file, data.getvalue())

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
            count = sum(name.startswith("weight_") for name in arrays)
            layers = tuple((_real(arrays[f"weight_{k}"]), _real(arrays[f"bias_{k}"])) for k in range(count))
            if about["format"] != FORMAT:
                raise ValueError(f"its format is {about['format']!r}; this version reads {FORMAT}")
            low, high = _numbers(about["throttle"])
            return cls(
                task=str(about["task"]),
                inputs=tuple(map(str, about["inputs"])),
                scale=_numbers(about["scale"]),
                throttle=(low, high),
                layers=layers,
                training=dict(about["training"]),
            )
        except AutodriveError as error:
            raise SpecError([f"{file}: {error}"]) from None
        except Exception as error:  # numpy, zipfile and json raise what they like for damaged files
            reason = " ".join(str(error).split()) or type(error).__name__
            raise SpecError([f"{file} is not a policy: {reason}"]) from None


class Memory:
    """What `count` cars read and what their policy put out in the last steps, as far as its inputs need it."""

    def __init__(self, inputs: tuple[str, ...], readings: Sequence[str], count: int = 1) -> None:
        """`readings`: names of the numbers given to `add` and `begin`. Raises `AutodriveError` if one is missing."""
        columns = [*readings, *OUTPUTS]
        needed = moments(inputs)
        if unknown := [name for name, _ in needed if name not in columns]:
            raise AutodriveError(f"the policy reads {unknown[0]}, which is not among its readings")
        self._columns = np.array([columns.index(name) for name, _ in needed])
        self._ago = np.array([ago for _, ago in needed])
        self._past = np.zeros((int(self._ago.max(initial=0)) + 1, count, len(columns)))

    def begin(self, readings: NDArray[Any], cars: Any = slice(None)) -> None:
        """An episode of those cars begins with these readings, shape (n, n_reading): they count for all moments."""
        self._past[:, cars, : -len(OUTPUTS)] = readings
        self._past[:, cars, -len(OUTPUTS) :] = 0.0

    def add(self, readings: NDArray[Any]) -> None:
        """The readings of all cars one step later, shape (count, n_reading)."""
        self._past[1:] = self._past[:-1].copy()
        self._past[0, :, : -len(OUTPUTS)] = readings

    def put_out(self, outputs: NDArray[Any]) -> None:
        """The outputs of all cars in this step, shape (count, 2)."""
        self._past[0, :, -len(OUTPUTS) :] = outputs

    @property
    def inputs(self) -> Floats:
        """Of all cars in this step, shape (count, n_input)."""
        return self._past[self._ago, :, self._columns].T


class Drivers:
    """A policy that drives `count` cars, and what it remembers of their episodes."""

    def __init__(self, policy: Policy, readings: Sequence[str], count: int = 1) -> None:
        """`readings`: names of the numbers given to `act`. Raises `AutodriveError` if the policy needs others."""
        self._policy = policy
        self._memory = Memory(policy.inputs, readings, count)
        self._has_begun = False

    def begin(self) -> None:
        """Forget everything: new episodes begin."""
        self._has_begun = False

    def act(self, readings: NDArray[Any]) -> Floats:
        """Throttle and steering, -1 to 1, left positive, shape (count, 2), for the readings of one more step.

        `readings`: shape (count, n_reading).
        """
        (self._memory.add if self._has_begun else self._memory.begin)(readings)
        self._has_begun = True
        outputs = self._policy.outputs(self._memory.inputs)
        self._memory.put_out(outputs)
        low, high = self._policy.throttle
        return np.column_stack([low + (high - low) * 0.5 * (outputs[:, 0] + 1.0), outputs[:, 1]])


class Driver:
    """Likewise, with one car."""

    def __init__(self, policy: Policy, readings: Sequence[str]) -> None:
        """See `Drivers`."""
        self._drivers = Drivers(policy, readings)

    def begin(self) -> None:
        """See `Drivers`."""
        self._drivers.begin()

    def act(self, readings: NDArray[Any]) -> tuple[float, float]:
        """Throttle and steering for the readings of one more step, shape (n_reading,)."""
        throttle, steering = self._drivers.act(readings[None])[0].tolist()
        return throttle, steering


def moments(inputs: Sequence[str]) -> list[tuple[str, int]]:
    """Name and number of steps ago of each input. Raises `AutodriveError` if one cannot be."""
    found = []
    for one in inputs:
        name, at, ago = one.partition("@")
        if at and not (ago.isdecimal() and 1 <= int(ago) <= LONGEST):
            raise AutodriveError(f"input '{one[:80]}' of the policy: after '@' come the steps ago, 1 to {LONGEST}")
        if name in OUTPUTS and not at:
            raise AutodriveError(
                f"input '{name}' of the policy is its own output: it can be read one step later, '{name}@1'"
            )
        found.append((name, int(ago) if at else 0))
    return found


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


def _arrays(file: Path) -> dict[str, NDArray[Any]]:
    if file.stat().st_size > MOST_BYTES:
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
