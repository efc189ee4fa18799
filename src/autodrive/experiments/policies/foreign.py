"""Foreign policies: networks in ONNX files, made by ML-Agents or another library, that choose among discrete actions.

Inputs of ML-Agents are `obs_0`, `obs_1`, ... (older: `vector_observation`), `action_masks` and `prev_action`; its
outputs `deterministic_discrete_actions`, `discrete_actions` (sampled), and in older files `action`. Names may have a
suffix (`obs_0:0`). A network of another library has one input, and one output with a score for each choice or the
number of the choice.
"""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Integers
from autodrive.base.errors import SpecError
from autodrive.experiments.network_process import NetworkError, NetworkProcess

MOST_BYTES = 2**26
"""Largest file that is read."""
MOST_CHARACTERS = 500
"""Longest text of an error: names and shapes in a file can be of any length."""
MASKS, PREVIOUS = "action_masks", "prev_action"
OUTPUTS = ("deterministic_discrete_actions", "discrete_actions", "discrete_action", "action")
"""Outputs of ML-Agents, the best one first: the same observation then gives the same action."""
MEMORY = ("recurrent_in", "recurrent_in_h", "recurrent_in_c", "memory")


class Shape(NamedTuple):
    """What a network reads and chooses in a task."""

    task: str
    observation: tuple[int, ...]
    """Widths of the parts of the observation, in order; a network may read them as one input or one by one."""
    branches: tuple[int, ...]
    """Throttles and steering angles; the number of choices is their product."""

    @property
    def width(self) -> int:
        """Number of values of the observation."""
        return sum(self.observation)

    @property
    def choices(self) -> int:
        """Number of actions."""
        return int(np.prod(self.branches))


SHAPES = {
    "crossing": Shape("crossing", (14,), (2, 3)),
    "duel": Shape("duel", (54, 1), (3, 3)),
}
"""Shapes of the published benchmarks."""


class ForeignPolicy:
    """A network that drives the cars of `Shape.task`."""

    def __init__(self, file: str | Path, task: str) -> None:
        """Raises `SpecError` if the file is no network of this shape, or if `onnxruntime` is not installed."""
        self.shape = SHAPES[task]
        self._file = file
        self._network = self._opened()
        self._inputs = self._found_inputs()
        self._output = self._found_output()
        self.act(np.zeros((1, self.shape.width), np.float32))  # what is wrong is found here, not while a car drives

    def act(self, observations: NDArray[np.float32]) -> Integers:
        """The number of the choice of each car, shape (n,), for observations of the shape (n, width).

        Choice 3 i + j has the i-th throttle and the j-th steering. Raises `SpecError` if the outputs do not fit.
        """
        if self._is_single and len(observations) > 1:
            return np.concatenate([self.act(observation[None]) for observation in observations])
        inputs = {name: make(observations) for name, make in self._inputs.items()}
        try:
            values = self._network.run(self._output, inputs)
        except NetworkError as error:
            raise self._error(f"the network does not run: {error}") from None
        return self._chosen(np.asarray(values).reshape(len(observations), -1))

    def _opened(self) -> NetworkProcess:
        if find_spec("onnxruntime") is None:
            raise self._error("an ONNX file needs onnxruntime; install it with:  pip install -e '.[onnx]'")
        file = Path(self._file)
        if not file.is_file():
            raise self._error("there is no such file")
        if file.stat().st_size > MOST_BYTES:
            raise self._error(f"the file has more than {MOST_BYTES} bytes")
        try:
            return NetworkProcess(file.read_bytes())
        except NetworkError as error:
            raise self._error(f"the file is not a network in the format ONNX, or exceeds a limit: {error}") from None

    def _found_inputs(self) -> dict[str, Any]:
        """What goes into each input, as a function of the observations."""
        made: dict[str, Any] = {}
        parts: list[tuple[str, int]] = []
        self._is_single = False
        for tensor in self._network.ports.inputs:
            name, width = _plain(tensor.name), tensor.shape[-1] if len(tensor.shape) == 2 else None
            if name in MEMORY:
                raise self._error(f"input '{tensor.name}': networks with a memory are not supported")
            self._is_single = self._is_single or tensor.shape[:1] == [1]
            if name in (MASKS, PREVIOUS):
                columns = sum(self.shape.branches) if name == MASKS else len(self.shape.branches)
                if isinstance(width, int) and width != columns:
                    raise self._error(f"input '{tensor.name}' has {width} numbers for a car, {self._wanted}")
                made[tensor.name] = _constant(1.0 if name == MASKS else 0.0, columns, tensor.type)
            elif "float" not in tensor.type or not isinstance(width, int):
                raise self._error(f"input '{tensor.name}' is {tensor.type} of the shape {tensor.shape}, {self._wanted}")
            else:
                parts.append((tensor.name, width))
        parts.sort(key=lambda part: [int(number) for number in re.findall(r"\d{1,18}", part[0])])
        made |= self._columns(parts)
        return made

    def _columns(self, parts: list[tuple[str, int]]) -> dict[str, Any]:
        """The columns of the observation for each input: all of it, or its parts in any order."""
        widths = [width for _, width in parts]
        if widths == [self.shape.width]:
            return {parts[0][0]: lambda observations: observations}
        if sorted(widths) != sorted(self.shape.observation):
            raise self._error(
                f"the observations of the network have {' + '.join(map(str, widths)) or 'no'} numbers, {self._wanted}"
            )
        starts = {width: sum(self.shape.observation[:k]) for k, width in enumerate(self.shape.observation)}
        return {name: _slice(starts[width], width) for name, width in parts}

    def _found_output(self) -> str:
        outputs = {_plain(tensor.name): tensor.name for tensor in self._network.ports.outputs}
        for name in OUTPUTS:
            if name in outputs:
                return outputs[name]
        if len(outputs) == 1:
            return next(iter(outputs.values()))
        raise self._error(
            f"the outputs of the network are {', '.join(outputs)}; one output must be one of {', '.join(OUTPUTS)}"
        )

    def _chosen(self, values: NDArray[Any]) -> Integers:
        """Numbers of the choices, from those of the branches, or from scores of choices or branches."""
        branches, width = self.shape.branches, values.shape[1]
        limits = {1: (self.shape.choices,), len(branches): branches}.get(width)
        if limits is not None:
            columns = np.where(np.isfinite(values), np.rint(values), -1).astype(np.int64)
            for row in np.flatnonzero(((columns < 0) | (columns >= limits)).any(axis=1))[:1]:
                raise self._error(
                    f"the network chose {values[row].tolist()}; the choices are 0 to {[n - 1 for n in limits]}"
                )
        elif np.isnan(values).any():
            raise self._error("the scores of the network are not numbers")
        elif width == self.shape.choices:
            return values.argmax(axis=1)
        elif width == sum(branches):
            columns = np.column_stack([scores.argmax(axis=1) for scores in np.split(values, [branches[0]], axis=1)])
        else:
            raise self._error(f"output '{self._output}' has {width} numbers for a car, {self._wanted}")
        return columns[:, 0] if len(columns.T) == 1 else columns[:, 0] * branches[-1] + columns[:, 1]

    @property
    def _wanted(self) -> str:
        s = self.shape
        return (
            f"but a network for '{s.task}' reads {s.width} numbers and chooses one of {s.choices} actions "
            f"({s.branches[0]} x {s.branches[1]})"
        )

    def _error(self, text: str) -> SpecError:
        return SpecError([f"{self._file}: {text[:MOST_CHARACTERS]}"])


def _plain(name: str) -> str:
    """A name without the suffix of a framework, as in obs_0:0, and without the path of a scope."""
    return name.split(":", maxsplit=1)[0].rsplit("/", 1)[-1]


def _constant(value: float, columns: int, kind: str) -> Any:
    dtype = np.float32 if "float" in kind else np.int64 if "int64" in kind else np.int32
    return lambda observations: np.full((len(observations), columns), value, dtype)


def _slice(start: int, width: int) -> Any:
    return lambda observations: np.ascontiguousarray(observations[:, start : start + width])
