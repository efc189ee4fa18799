"""Reads the layers of a network in an ONNX file, for a car that has NumPy only."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import numpy_helper

from autodrive.base.errors import SpecError

MOST_BYTES = 2**26
"""Largest file that is read."""
FUNCTIONS = {"Tanh": "tanh", "Relu": "relu", "Sigmoid": "sigmoid"}
"""Functions without attributes: name in ONNX -> name in `autodrive.experiments.deployment.driver.ACTIVATIONS`."""
SLOPES = {"Elu": ("elu", 1.0), "LeakyRelu": ("leaky_relu", 0.01)}
"""Functions with the attribute alpha, and its default."""
UNCHANGED = {"Identity", "Flatten", "Dropout", "Cast", "Squeeze", "Unsqueeze", "Reshape"}
"""Operators that leave the numbers of one car as they are."""


class OnnxLayers(NamedTuple):
    """The layers of a network: weights, shape (n_out, n_in), biases, and the name of the function after each."""

    layers: list[tuple[NDArray[Any], NDArray[Any]]]
    activations: list[str]


def read_layers(file: Path, width: int) -> OnnxLayers:
    """The layers of a chain of matrix products, sums, and functions, for `width` inputs and two outputs.

    Raises `SpecError` for a file that is no network, or for another network, with the name of the operator.
    """
    model = _model(file)
    constants = {tensor.name: _array(file, tensor) for tensor in model.graph.initializer}
    inputs = [tensor for tensor in model.graph.input if tensor.name not in constants]
    if len(inputs) != 1:
        raise _error(file, f"the network has {len(inputs)} inputs; a policy for a car has one, with {width} numbers")
    chain = _LayerChain(width)
    current = inputs[0].name
    for node in model.graph.node:
        if node.op_type == "Constant":
            constants[node.output[0]] = _array(file, node.attribute[0].t)
        elif current in node.input:
            _follow(file, chain, node, current, constants)
            current = node.output[0]
        else:
            raise _error(file, f"the operator {node.op_type} is not part of a chain from the input to the output")
    if current not in [tensor.name for tensor in model.graph.output]:
        raise _error(file, "the last operator does not give the output of the network")
    result = chain.result()
    if len(result.layers[-1][1]) != 2:
        raise _error(file, f"the network has {len(result.layers[-1][1])} outputs; a policy has throttle and steering")
    return result


class _LayerChain:
    """Layers as they are followed; an affine step is joined with the affine step before."""

    def __init__(self, width: int) -> None:
        self._weight, self._bias = np.eye(width), np.zeros(width)
        self._layers: list[tuple[NDArray[Any], NDArray[Any]]] = []
        self._activations: list[str] = []

    @property
    def width(self) -> int:
        return len(self._bias)

    def affine(self, weight: NDArray[Any], bias: NDArray[Any]) -> None:
        self._weight, self._bias = weight @ self._weight, weight @ self._bias + bias

    def function(self, name: str) -> None:
        self._layers.append((self._weight, self._bias))
        self._activations.append(name)
        self._weight, self._bias = np.eye(self.width), np.zeros(self.width)

    def result(self) -> OnnxLayers:
        if not self._layers or not np.array_equal(self._weight, np.eye(self.width)) or self._bias.any():
            self.function("none")
        return OnnxLayers(self._layers, self._activations)


def _follow(
    file: Path, chain: _LayerChain, node: onnx.NodeProto, current: str, constants: dict[str, NDArray[Any]]
) -> None:
    """Add an operator to the chain."""
    attributes = {attribute.name: onnx.helper.get_attribute_value(attribute) for attribute in node.attribute}
    kind = node.op_type
    others = [name for name in node.input if name and name != current]
    is_joined = list(node.input).count(current) > 1 or any(name not in constants for name in others)
    if kind not in UNCHANGED and is_joined:
        raise _error(file, f"the operator {kind} has two inputs that are not constant; a policy is one chain of layers")
    values = [constants.get(name, np.empty(0)) for name in others]
    try:
        if kind in UNCHANGED:
            return
        if kind in FUNCTIONS:
            chain.function(FUNCTIONS[kind])
        elif kind in SLOPES:
            name, slope = SLOPES[kind]
            chain.function(f"{name}:{attributes.get('alpha', slope):.17g}")
        elif kind == "Clip":
            low, high = (*values, np.array(np.inf))[:2] if values else (attributes["min"], attributes["max"])
            chain.function(f"clip:{float(low):.17g}:{float(high):.17g}")
        elif (kind in AFFINE and node.input[0] == current) or kind in ("Add", "Mul"):
            chain.affine(*AFFINE[kind](chain.width, values, attributes))
        else:
            known = ", ".join(sorted({*AFFINE, *FUNCTIONS, *SLOPES, *UNCHANGED, "Clip"}))
            raise _error(file, f"the operator {kind} is not known for a car. Known: {known}")
    except (ValueError, IndexError, KeyError) as error:
        raise _error(file, f"the operator {kind} has shapes or attributes that do not fit: {error}") from None


def _gemm(width: int, values: list[NDArray[Any]], attributes: dict[str, Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    if attributes.get("transA"):
        raise ValueError("transA is set")
    weight = values[0] if attributes.get("transB") else values[0].T
    bias = np.broadcast_to(values[1].reshape(-1), len(weight)) if len(values) > 1 else np.zeros(len(weight))
    return attributes.get("alpha", 1.0) * weight, attributes.get("beta", 1.0) * bias


def _row(width: int, value: NDArray[Any]) -> NDArray[Any]:
    return np.broadcast_to(value.reshape(-1), width)


AFFINE: dict[str, Callable[[int, list[NDArray[Any]], dict[str, Any]], tuple[NDArray[Any], NDArray[Any]]]] = {
    "Gemm": _gemm,
    "MatMul": lambda width, values, _: (values[0].T, np.zeros(values[0].shape[1])),
    "Add": lambda width, values, _: (np.eye(width), _row(width, values[0])),
    "Sub": lambda width, values, _: (np.eye(width), -_row(width, values[0])),
    "Mul": lambda width, values, _: (np.diag(_row(width, values[0])), np.zeros(width)),
    "Div": lambda width, values, _: (np.diag(1.0 / _row(width, values[0])), np.zeros(width)),
}
"""Weight and bias of an operator, for the number of its inputs, its constants and its attributes."""


def _model(file: Path) -> onnx.ModelProto:
    if not file.is_file():
        raise _error(file, "there is no such file")
    if file.stat().st_size > MOST_BYTES:
        raise _error(file, f"the file has more than {MOST_BYTES} bytes")
    try:
        model = onnx.load(file, load_external_data=False)
    except Exception as error:  # protobuf raises what it likes for damaged files
        raise _error(file, f"the file is not a network in the format ONNX: {error}") from None
    if not model.graph.node:
        raise _error(file, "the file is not a network in the format ONNX: it has no operators")
    return model


def _array(file: Path, tensor: onnx.TensorProto) -> NDArray[Any]:
    if tensor.external_data:
        raise _error(file, f"the numbers of '{tensor.name}' are in another file; export the network as one file")
    return np.asarray(numpy_helper.to_array(tensor), np.float64)


def _error(file: Path, text: str) -> SpecError:
    return SpecError([f"{file}: {' '.join(text.split())[:500]}"])
