"""A policy: a network from numbers that a car senses to throttle and steering, in NumPy.

A file of a policy is an .npz archive (`numpy.savez`): the arrays `weight_0`, `bias_0`, `weight_1` ... of the layers,
and `about`, JSON with the other attributes of `Policy`.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass(frozen=True)
class Policy:
    """A network with tanh between its layers. Raises `AutodriveError` for shapes that do not fit."""

    task: str
    """Name of the task of `autodrive.experiments.envs` that it was trained for."""
    inputs: tuple[str, ...]
    """Names of the features that it reads, in order (`autodrive.experiments.envs.episodes.observed`)."""
    scale: tuple[float, ...]
    """Factor of each feature."""
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

    def act(self, features: NDArray[Any]) -> tuple[float, float]:
        """Throttle and steering, -1 to 1, left positive, for the features `inputs`, shape (n_input,).

        The bits are the same on every processor.
        """
        values = np.asarray(features, np.float64) * np.array(self.scale)
        for weight, bias in self.layers[:-1]:
            values = _layer(weight, bias, values, is_inner=True)
        values = _layer(*self.layers[-1], values, is_inner=False)
        drive, steer = np.clip(values, -1.0, 1.0).tolist()
        low, high = self.throttle
        return low + (high - low) * 0.5 * (drive + 1.0), steer

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


@jit
def _layer(weight: NDArray[np.float32], bias: NDArray[np.float32], values: Floats, is_inner: bool) -> Floats:
    """The outputs of a layer, shape (n_out,)."""
    outputs = np.empty(len(bias))
    for i in range(len(bias)):
        total = float(bias[i])
        for k in range(len(values)):
            total += weight[i, k] * values[k]
        outputs[i] = 1.0 - 2.0 / (exp(2.0 * total) + 1.0) if is_inner else total
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
