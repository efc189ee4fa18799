"""The folder for a car: its files, networks in the format ONNX against onnxruntime, errors, and the document."""

from __future__ import annotations

import ast
import inspect
import itertools
import json
import math
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from autodrive.base.errors import SpecError
from autodrive.experiments.deployment import driver as driver_module
from autodrive.experiments.deployment.deploy import KNOWN, STEP, deploy
from autodrive.experiments.deployment.driver import CarPolicy, CarSettings
from autodrive.experiments.envs.roboracer_env import RoboRacerVectorEnv
from autodrive.experiments.envs.time_trial import WHEEL_RADIUS, TimeTrial
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.command_line import call, refused
from tests.support.tables import rewritten

ROOT = Path(__file__).parents[3]
DOCUMENT = ROOT / "docs" / "deploy.md"
WIDTH = 60
"""Numbers of the observation 'lidar' of RoboRacer-v0."""


def network(file: Path, nodes: list[onnx.NodeProto], constants: dict[str, Any], width: int = WIDTH) -> Path:
    """Write a network from `obs` to `action`, which the library `onnx` has checked."""
    ports = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", n]) for name, n in
             (("obs", width), ("action", None))]  # fmt: skip
    tensors = [numpy_helper.from_array(np.asarray(value, np.float32), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "policy", ports[:1], ports[1:], tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(file))
    return file


def learnt(file: Path, seed: int = 4) -> Path:
    """A network with a normalisation, three kinds of layers, and a limit of its output."""
    rng = np.random.default_rng(seed)
    constants = {
        "mean": rng.normal(0.0, 1.0, WIDTH), "deviation": rng.uniform(0.5, 2.0, WIDTH),
        "w0": rng.normal(0.0, 0.2, (24, WIDTH)), "b0": rng.normal(0.0, 0.1, 24),
        "w1": rng.normal(0.0, 0.3, (24, 16)), "b1": rng.normal(0.0, 0.1, 16),
        "w2": rng.normal(0.0, 0.3, (2, 16)), "b2": rng.normal(0.0, 0.1, 2), "low": -0.8, "high": 0.9,
    }  # fmt: skip
    node = helper.make_node
    nodes = [
        node("Sub", ["obs", "mean"], ["a"]), node("Div", ["a", "deviation"], ["b"]), node("Flatten", ["b"], ["c"]),
        node("Gemm", ["c", "w0", "b0"], ["d"], transB=1, alpha=0.5), node("Elu", ["d"], ["e"], alpha=0.7),
        node("MatMul", ["e", "w1"], ["f"]), node("Add", ["b1", "f"], ["g"]), node("Relu", ["g"], ["h"]),
        node("Gemm", ["h", "w2", "b2"], ["i"], transB=1), node("Clip", ["i", "low", "high"], ["action"]),
    ]  # fmt: skip
    return network(file, nodes, constants)


def test_an_onnx_policy_gives_the_numbers_of_onnxruntime(tmp_path: Path) -> None:
    file = learnt(tmp_path / "learnt.onnx")
    deploy(str(file), tmp_path / "car")
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    rng, names = np.random.default_rng(0), list(KNOWN)
    policy = CarPolicy(tmp_path / "car" / "policy.npz", names)
    observed = [feature.name for feature in TimeTrial(STEP).features[:5]] + ["scan_age", *KNOWN[6:]]
    for _ in range(20):
        numbers = rng.uniform(-2.0, 6.0, WIDTH).astype(np.float32)
        readings = np.array([numbers[observed.index(name)] for name in names], np.float64)
        (expected,) = session.run(["action"], {"obs": numbers[None]})
        # onnxruntime computes in single precision
        assert policy.act(readings) == pytest.approx(np.asarray(expected)[0], abs=2e-6)


@pytest.mark.parametrize(
    ("nodes", "constants", "text"),
    [
        ([helper.make_node("Sin", ["obs"], ["action"])], {}, "the operator Sin is not known for a car. Known: Add"),
        ([helper.make_node("Add", ["obs", "obs"], ["action"])], {}, "the operator Add has two inputs"),
        (
            [helper.make_node("Tanh", ["obs"], ["a"]), helper.make_node("Mul", ["a", "obs"], ["action"])],
            {},
            "the operator Mul has two inputs that are not constant",
        ),
        ([helper.make_node("MatMul", ["obs", "w"], ["action"])], {"w": np.ones((60, 3))}, "has 3 outputs"),
    ],
)
def test_a_network_that_is_no_chain_of_layers_is_refused(
    nodes: list[onnx.NodeProto], constants: dict[str, Any], text: str, tmp_path: Path
) -> None:
    with pytest.raises(SpecError, match=text):
        deploy(str(network(tmp_path / "odd.onnx", nodes, constants)), tmp_path / "car")


def test_other_files_are_refused(tmp_path: Path) -> None:
    wide = network(tmp_path / "wide.onnx", [helper.make_node("MatMul", ["obs", "w"], ["action"])],
                   {"w": np.ones((54, 2))}, 54)  # fmt: skip
    with pytest.raises(SpecError, match="the operator MatMul has shapes"):
        deploy(str(wide), tmp_path / "car")
    (tmp_path / "text.onnx").write_text("no network")
    for file, text in [("text.onnx", "not a network in the format ONNX"), ("none.onnx", "there is no such file")]:
        with pytest.raises(SpecError, match=text):
            deploy(str(tmp_path / file), tmp_path / "car")
    with pytest.raises(SpecError, match="was trained for the task 'crossing'"):
        deploy("crossing", tmp_path / "car")
    with pytest.raises(SpecError, match="setting 'spede' is not known"):
        deploy("race", tmp_path / "car", changes=["spede=1"])


def test_the_command_writes_a_folder_with_the_values_of_the_vehicle(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "my_car"
    printed = call("deploy", "race", "--car", "roboracer_f1tenth", "-o", folder, "--set", "speed_cap=1.5")
    assert "ros2_node.py --dry-run" in str(printed)
    assert {file.name for file in folder.iterdir()} == {
        "README.md", "devkit_script.py", "driver.py", "policy.npz", "ros1_node.py", "ros2_node.py", "settings.json",
    }  # fmt: skip
    settings = CarSettings.read(folder / "settings.json")
    car = load_vehicle("roboracer_f1tenth")
    assert settings.speed_cap == 1.5
    assert settings.car_full_speed == pytest.approx(20.0, abs=0.01)
    assert settings.full_speed == pytest.approx(25.252, abs=0.01)
    assert settings.steering_limit == pytest.approx(math.radians(24.0012), abs=1e-5)
    assert settings.half_width == pytest.approx(0.155)
    assert (settings.wheelbase, settings.front) == (car.wheelbase, pytest.approx(car.front, abs=1e-4))
    assert "the files exist" in refused("deploy", "race", "-o", folder)


def test_the_defaults_are_those_of_the_training_with_the_included_policy() -> None:
    settings, car, scan = CarSettings(), load_vehicle("roboracer"), TimeTrial.scan
    assert settings.period == pytest.approx(TimeTrial(STEP).scenario.tick * STEP)
    assert settings.full_speed == pytest.approx(car.full_throttle_speed, abs=1e-3)
    assert settings.full_angle == pytest.approx(car.steering.limit, abs=1e-4)
    assert settings.wheel_radius == WHEEL_RADIUS == car.wheels.radius
    assert (settings.first_degree, settings.sector_degrees, settings.sectors, settings.sector_range) == scan
    assert inspect.signature(RoboRacerVectorEnv).parameters["frame_skip"].default == STEP


def test_the_folder_drives_without_the_simulator(tmp_path: Path) -> None:
    deploy("race", tmp_path)
    program = """
import sys
sys.modules["autodrive"] = None
from driver import CarSettings, CarDriver, ScanLayout
from pathlib import Path
settings = CarSettings.read(Path("settings.json"), ["dead_man_topic="])
driver = CarDriver(settings, Path("."))
driver.on_speed(1.0, 1.0), driver.on_yaw_rate(1.0, 0.0)
layout, ranges = ScanLayout(-2.356, 0.00436, 1081, 0.06, 10.0), [2.0 + 0.001 * k for k in range(1081)]
command = driver.on_scan(1.0, 1.0, layout, ranges)
print(command.stop == "" and command.speed > 0.0, *{"numba", "jax", "gymnasium"} & {*sys.modules})
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["True"], done.stderr


def settings_rows() -> list[str]:
    """The table of all settings: name, default, description."""
    tree = ast.parse(Path(driver_module.__file__).read_text(encoding="utf-8"))
    (body,) = [node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "CarSettings"]
    defaults = asdict(CarSettings())
    rows = ["| setting | default | description |", "|---|---|---|"]
    for field, text in itertools.pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            assert isinstance(text, ast.Expr), field.target.id
            assert isinstance(text.value, ast.Constant), field.target.id
            described = " ".join(str(text.value.value).split())
            rows.append(f"| `{field.target.id}` | `{json.dumps(defaults[field.target.id])}` | {described} |")
    return rows


def test_the_document_lists_all_settings() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    assert text == rewritten(text, {"settings": settings_rows()})


if __name__ == "__main__":
    DOCUMENT.write_text(
        rewritten(DOCUMENT.read_text(encoding="utf-8"), {"settings": settings_rows()}), encoding="utf-8"
    )
