"""Networks in ONNX files with the published shapes drive; what does not fit is named."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from typer.testing import CliRunner

from autodrive.base.errors import SpecError
from autodrive.cli.app import app
from autodrive.experiments.policies.foreign import ForeignPolicy
from autodrive.experiments.policies.team import drive, foreign_team, show

FLOAT, INT64 = TensorProto.FLOAT, TensorProto.INT64
HIDDEN = 16


def save(
    file: Path,
    inputs: Mapping[str, tuple[int, Sequence[Any]]],
    outputs: Mapping[str, tuple[int, Sequence[Any]]],
    nodes: list[onnx.NodeProto],
    constants: dict[str, np.ndarray],
) -> str:
    """Write a network, which the library `onnx` has checked."""
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(name, *one) for name, one in inputs.items()],
        [helper.make_tensor_value_info(name, *one) for name, one in outputs.items()],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 15)], ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(file))
    return str(file)


def layers(widths: tuple[int, ...], seed: int = 1) -> dict[str, np.ndarray]:
    """Random weights, as float32."""
    rng = np.random.default_rng(seed)
    made = {}
    for k, (before, after) in enumerate(itertools.pairwise(widths)):
        made[f"w{k}"] = rng.normal(0.0, 1.0, (before, after)).astype(np.float32)
        made[f"b{k}"] = rng.normal(0.0, 1.0, after).astype(np.float32)
    return made


def scores(weights: dict[str, np.ndarray], observations: np.ndarray) -> np.ndarray:
    """The network in NumPy."""
    hidden = np.maximum(observations @ weights["w0"] + weights["b0"], 0.0)
    return hidden @ weights["w1"] + weights["b1"]


def mlp_nodes(source: str, output: str) -> list[onnx.NodeProto]:
    return [
        helper.make_node("Gemm", [source, "w0", "b0"], ["h"]),
        helper.make_node("Relu", ["h"], ["r"]),
        helper.make_node("Gemm", ["r", "w1", "b1"], [output]),
    ]


def ml_agents(file: Path, observations: tuple[int, ...], branches: tuple[int, int], batch: Any = "batch") -> dict:
    """As ML-Agents writes it: observations, masks of the actions, and the chosen number of each branch."""
    weights, total = layers((sum(observations), HIDDEN, sum(branches))), sum(branches)
    names = [f"obs_{k}" for k in range(len(observations))]
    inputs = {name: (FLOAT, [batch, width]) for name, width in zip(names, observations, strict=True)}
    inputs["action_masks"] = (FLOAT, [batch, total])
    outputs = {"version_number": (FLOAT, [1]), "discrete_actions": (INT64, [batch, 2])}
    nodes = [
        helper.make_node("Concat", names, ["x"], axis=1),
        *mlp_nodes("x", "s"),
        helper.make_node("Sub", ["action_masks", "one"], ["forbidden"]),
        helper.make_node("Mul", ["forbidden", "big"], ["penalty"]),
        helper.make_node("Add", ["s", "penalty"], ["allowed"]),
        helper.make_node("Split", ["allowed", "sizes"], ["first", "second"], axis=1),
        helper.make_node("ArgMax", ["first"], ["i"], axis=1, keepdims=1),
        helper.make_node("ArgMax", ["second"], ["j"], axis=1, keepdims=1),
        helper.make_node("Concat", ["i", "j"], ["discrete_actions"], axis=1),
        helper.make_node("Identity", ["version"], ["version_number"]),
    ]
    constants = {
        **weights,
        "one": np.ones(1, np.float32),
        "big": np.full(1, 1e8, np.float32),
        "sizes": np.array(branches, np.int64),
        "version": np.full(1, 3.0, np.float32),
    }
    save(file, inputs, outputs, nodes, constants)
    return weights


def plain(file: Path, width: int, choices: int) -> dict:
    """Of another library: a score for each choice."""
    weights = layers((width, HIDDEN, choices))
    sizes = {"observation": (FLOAT, ["n", width])}, {"scores": (FLOAT, ["n", choices])}
    save(file, *sizes, mlp_nodes("observation", "scores"), weights)
    return weights


def polite(file: Path) -> str:
    """A network that solves the crossing: cars that head east or west drive twice as fast as the others."""
    select = np.zeros((14, 6), np.float32)
    select[0, 4], select[1, 4] = 1.0, -1.0  # throttle 1, straight on: |x| - |y| of the goal
    bias = np.array([-9, 0, -9, -9, 0, -9], np.float32)  # 1: throttle 0.5, straight on
    nodes = [helper.make_node("Abs", ["obs_0"], ["a"]), helper.make_node("Gemm", ["a", "w", "b"], ["action"])]
    sizes = {"obs_0": (FLOAT, ["batch", 14])}, {"action": (FLOAT, ["batch", 6])}
    return save(file, *sizes, nodes, {"w": select, "b": bias})


@pytest.mark.parametrize(
    ("task", "observations", "branches", "batch"),
    [
        ("crossing", (14,), (2, 3), "batch"),
        ("crossing", (14,), (2, 3), 1),
        ("duel", (54, 1), (3, 3), "batch"),
        ("duel", (1, 54), (3, 3), "batch"),
    ],
)
def test_a_network_of_ml_agents_chooses_as_numpy_does(
    tmp_path: Path, task: str, observations: tuple[int, ...], branches: tuple[int, int], batch: Any
) -> None:
    weights = ml_agents(tmp_path / "policy.onnx", observations, branches, batch)
    policy = ForeignPolicy(tmp_path / "policy.onnx", task)
    seen = np.random.default_rng(2).normal(0.0, 1.0, (50, sum(observations))).astype(np.float32)
    read = np.roll(seen, 1, axis=1) if observations == (1, 54) else seen  # our speed is the last number
    parts = np.split(scores(weights, read), [branches[0]], axis=1)
    expected = parts[0].argmax(axis=1) * branches[1] + parts[1].argmax(axis=1)
    assert policy.act(seen).tolist() == expected.tolist()
    assert len({*expected.tolist()}) > 3


@pytest.mark.parametrize(("task", "width", "choices"), [("crossing", 14, 6), ("duel", 55, 9)])
def test_a_network_with_a_score_for_each_choice_takes_the_best(
    tmp_path: Path, task: str, width: int, choices: int
) -> None:
    weights = plain(tmp_path / "policy.onnx", width, choices)
    seen = np.random.default_rng(3).normal(0.0, 1.0, (50, width)).astype(np.float32)
    chosen = ForeignPolicy(tmp_path / "policy.onnx", task).act(seen)
    assert chosen.tolist() == scores(weights, seen).argmax(axis=1).tolist()


@pytest.mark.slow
def test_a_network_drives_through_the_crossing_with_the_same_bits_in_one_world_and_in_many(tmp_path: Path) -> None:
    policy = foreign_team(ForeignPolicy(polite(tmp_path / "polite.onnx"), "crossing"))
    assert drive(policy, 3, seed=5).is_success.all()
    assert show(policy, 1, seed=5, mode=None).is_success.all()
    plain(tmp_path / "any.onnx", 14, 6)
    careless = foreign_team(ForeignPolicy(tmp_path / "any.onnx", "crossing"))
    assert np.array_equal(drive(careless, 2, seed=1), show(careless, 2, seed=1, mode=None))


def test_a_network_with_any_weights_drives_a_duel_to_its_end(tmp_path: Path) -> None:
    ml_agents(tmp_path / "policy.onnx", (54, 1), (3, 3))
    assert drive(foreign_team(ForeignPolicy(tmp_path / "policy.onnx", "duel")), 2).is_success.shape == (2, 2)


def keeper(file: Path, throttle: int) -> str:
    """A network for the duel that keeps to the middle: it steers to the side on which the rays see farther."""
    select, bias = np.zeros((55, 6), np.float32), np.zeros(6, np.float32)
    bias[throttle] = 1.0
    bias[4] = 0.05  # straight on, unless a side is better
    for k in range(4, 8):  # 42 to 73 degrees to the right and to the left
        right, left = 2 * (2 * k - 1) + 1, 2 * (2 * k) + 1
        select[left, 3] = select[right, 5] = 1.0
        select[right, 3] = select[left, 5] = -1.0
    nodes = [
        helper.make_node("Concat", ["obs_0", "obs_1"], ["x"], axis=1),
        helper.make_node("Gemm", ["x", "w", "b"], ["action"]),
    ]
    sizes = {"obs_0": (FLOAT, ["batch", 54]), "obs_1": (FLOAT, ["batch", 1])}, {"action": (FLOAT, ["batch", 6])}
    return save(file, *sizes, nodes, {"w": select, "b": bias})


def test_a_network_drives_a_lap_of_the_published_duel_and_the_rival_has_its_own(tmp_path: Path) -> None:
    """The second car drives too fast with throttle 1."""
    command = ["play", "duel", keeper(tmp_path / "slow.onnx", 1), "--headless", "--episodes", "1"]
    whole = "1 episode: 100.0% of the cars succeeded, all 2 in 100.0%; V1 in 100.0%, V2 in 100.0%\n"
    assert CliRunner().invoke(app, command, catch_exceptions=False).output == whole
    command += ["--rival", keeper(tmp_path / "fast.onnx", 2)]
    half = "1 episode: 50.0% of the cars succeeded, all 2 in 0.0%; V1 in 100.0%, V2 in 0.0%\n"
    assert CliRunner().invoke(app, command, catch_exceptions=False).output == half


def test_the_command_prints_how_often_the_cars_succeeded(tmp_path: Path) -> None:
    command = ["play", "crossing", polite(tmp_path / "polite.onnx"), "--headless", "--episodes", "2"]
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert result.output == "2 episodes: 100.0% of the cars succeeded, all 4 in 100.0%\n"


def test_a_network_that_does_not_fit_is_named(tmp_path: Path) -> None:
    file = tmp_path / "policy.onnx"
    plain(file, 13, 6)
    wanted = "a network for 'crossing' reads 14 numbers and chooses one of 6 actions"
    assert_error(file, "crossing", f"the observations of the network have 13 numbers, but {wanted}")
    plain(file, 14, 7)
    assert_error(file, "crossing", f"output 'scores' has 7 numbers for a car, but {wanted}")
    assert_error(
        file, "duel", "the observations of the network have 14 numbers, but a network for 'duel' reads 55 numbers"
    )
    ml_agents(file, (54, 2), (3, 3))
    assert_error(file, "duel", "the observations of the network have 54 \\+ 2 numbers")
    file.write_bytes(b"no network")
    assert_error(file, "crossing", "the file is not a network in the format ONNX, or exceeds a limit: ")
    assert_error(tmp_path / "missing.onnx", "crossing", "missing.onnx: there is no such file")
    image = {"obs_0": (FLOAT, ["n", 14, 1])}, {"action": (FLOAT, ["n", 14, 1])}
    save(file, *image, [helper.make_node("Identity", ["obs_0"], ["action"])], {})
    assert_error(file, "crossing", r"input 'obs_0' is tensor\(float\) of the shape")
    memory = {"obs_0": (FLOAT, ["n", 14]), "recurrent_in": (FLOAT, [1, "n", 8])}, {"action": (FLOAT, ["n", 14])}
    save(file, *memory, [helper.make_node("Identity", ["obs_0"], ["action"])], {})
    assert_error(file, "crossing", "input 'recurrent_in': networks with a memory are not supported")


def test_a_choice_that_does_not_exist_is_named(tmp_path: Path) -> None:
    sizes = {"obs_0": (FLOAT, ["n", 14])}, {"discrete_actions": (FLOAT, ["n", 1])}
    nodes = [helper.make_node("Gemm", ["obs_0", "w", "b"], ["discrete_actions"])]
    constants = {"w": np.zeros((14, 1), np.float32), "b": np.full(1, 6.0, np.float32)}
    file = tmp_path / "policy.onnx"
    save(file, *sizes, nodes, constants)
    assert_error(file, "crossing", r"the network chose \[6.0\]; the choices are 0 to \[5\]")


def test_of_several_choices_the_one_that_does_not_exist_is_named(tmp_path: Path) -> None:
    """A network that draws its choices draws one too great from scores that are no numbers."""
    weights = np.zeros((14, 2), np.float32)
    weights[:2] = np.eye(2)
    sizes = {"obs_0": (FLOAT, ["n", 14])}, {"discrete_actions": (FLOAT, ["n", 2])}
    nodes = [helper.make_node("Gemm", ["obs_0", "w"], ["discrete_actions"])]
    save(tmp_path / "policy.onnx", *sizes, nodes, {"w": weights})
    policy = ForeignPolicy(tmp_path / "policy.onnx", "crossing")
    seen = np.zeros((2, 14), np.float32)
    seen[0, 0], seen[1, :2] = 1.0, (2.0, 3.0)
    with pytest.raises(SpecError, match=r"the network chose \[2.0, 3.0\]; the choices are 0 to \[1, 2\]"):
        policy.act(seen)
    seen[1, :2] = math.inf, 0.0
    with pytest.raises(SpecError, match=r"the network chose \[inf, .*\]; the choices are 0 to \[1, 2\]"):
        policy.act(seen)


def test_without_the_runtime_the_error_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    plain(tmp_path / "policy.onnx", 14, 6)
    assert_error(
        tmp_path / "policy.onnx", "crossing", r"needs onnxruntime; install it with:  pip install -e '\.\[onnx\]'"
    )


def assert_error(file: Path, task: str, error: str) -> None:
    with pytest.raises(SpecError, match=error):
        ForeignPolicy(file, task)
