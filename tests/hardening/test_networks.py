"""Networks and policies of strangers: what asks for too much time or memory ends in a sentence, within its limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from autodrive.base.errors import SpecError
from autodrive.experiments import network_process
from autodrive.experiments.network_process import NetworkError, NetworkProcess
from autodrive.experiments.policies.foreign import ForeignPolicy

FLOAT, INT64, BOOL = TensorProto.FLOAT, TensorProto.INT64, TensorProto.BOOL
pytestmark = pytest.mark.process


def network(
    nodes: list[onnx.NodeProto], constants: dict[str, np.ndarray], inputs: dict[str, list[Any]] | None = None
) -> bytes:
    """A network for the crossing with these nodes, which make 'y': one number, which is added to the observations."""
    nodes = [
        *nodes,
        helper.make_node("Add", ["obs_0", "y"], ["sum"]),
        helper.make_node("Gemm", ["sum", "w"], ["action"]),
    ]
    given = {"obs_0": ["n", 14], **(inputs or {})}
    graph = helper.make_graph(
        nodes,
        "hostile",
        [helper.make_tensor_value_info(name, FLOAT, shape) for name, shape in given.items()],
        [helper.make_tensor_value_info("action", FLOAT, ["n", 6])],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    graph.initializer.append(numpy_helper.from_array(np.zeros((14, 6), np.float32), "w"))
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 15)], ir_version=8).SerializeToString()


def loop() -> bytes:
    """Adds one 10^15 times."""
    body = helper.make_graph(
        [helper.make_node("Identity", ["on"], ["still_on"]), helper.make_node("Add", ["x", "one"], ["more"])],
        "body",
        [
            helper.make_tensor_value_info("number", INT64, []),
            helper.make_tensor_value_info("on", BOOL, []),
            helper.make_tensor_value_info("x", FLOAT, [1]),
        ],
        [helper.make_tensor_value_info("still_on", BOOL, []), helper.make_tensor_value_info("more", FLOAT, [1])],
    )
    constants = {"count": np.array(10**15), "true": np.array(True), "one": np.ones(1, np.float32)}
    return network([helper.make_node("Loop", ["count", "true", "one"], ["y"], body=body)], constants)


def giant(numbers: int) -> bytes:
    """The sum of so many zeros, of which each is in memory."""
    shape = {"shape": np.array([numbers])}
    zeros = helper.make_node("ConstantOfShape", ["shape"], ["zeros"])
    return network([zeros, helper.make_node("ReduceSum", ["zeros"], ["y"], keepdims=0)], shape)


def doubled(times: int) -> bytes:
    """A tensor that is concatenated with itself again and again."""
    nodes = [helper.make_node("Concat", [f"x{k}", f"x{k}"], [f"x{k + 1}"], axis=0) for k in range(times)]
    return network([*nodes, helper.make_node("ReduceMax", [f"x{times}"], ["y"], keepdims=0)], {"x0": np.ones(1, "f4")})


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (loop(), "the network takes more than 1 s"),
        (giant(10**9), "memory|alloc"),
        (giant(2**62), "the file is not a network|does not run"),
        (doubled(33), "memory|alloc"),
    ],
    ids=["loop", "giant", "overflow", "doubled"],
)
def test_a_network_that_asks_for_too_much_ends_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes, reason: str
) -> None:
    monkeypatch.setattr(network_process, "TIME_LIMIT", 1.0)
    file = tmp_path / "p.onnx"
    file.write_bytes(content)
    with pytest.raises(SpecError, match=reason) as caught:
        ForeignPolicy(file, "crossing")
    assert len(str(caught.value)) < 700


def test_its_process_has_no_more_memory_than_the_limit() -> None:
    process = NetworkProcess(giant(2**24))  # 64 MiB: allowed
    given = {"obs_0": np.zeros((1, 14), np.float32)}
    assert process.run("action", given).shape == (1, 6)
    peak = Path(f"/proc/{process.process.pid}/status").read_text().split("VmHWM:")[1].split()[0]
    assert 64 * 1024 < int(peak) < 500_000
    with pytest.raises(NetworkError, match=r"memory|alloc"):
        NetworkProcess(giant(2**27)).run("action", given)  # 512 MiB


def test_a_giant_mask_is_refused_before_it_is_made(tmp_path: Path) -> None:
    file = tmp_path / "p.onnx"
    mask = {"action_masks": ["n", 10**11]}
    file.write_bytes(network([helper.make_node("ReduceMax", ["action_masks"], ["y"], keepdims=0)], {}, mask))
    with pytest.raises(SpecError, match="input 'action_masks' has 100000000000 numbers for a car, but a network for"):
        ForeignPolicy(file, "crossing")


def test_names_and_shapes_of_any_length_make_a_short_sentence(tmp_path: Path) -> None:
    file = tmp_path / "p.onnx"
    for name, shape in (("obs_" + "9" * 5000, ["n", 13]), ("x" * 10**6, [1] * 1000)):
        file.write_bytes(network([helper.make_node("ReduceMax", [name], ["y"], keepdims=0)], {}, {name: shape}))
        with pytest.raises(SpecError) as caught:
            ForeignPolicy(file, "crossing")
        assert len(str(caught.value)) < 700
