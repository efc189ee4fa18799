"""The file of a campaign: checks, samples, pass criteria and intervals."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.base.errors import SpecError
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.expression import Expression
from autodrive.experiments.campaigns.sampling import Design, ParameterRange, Sampling
from autodrive.experiments.campaigns.statistics import mean_interval, wilson

Make = Callable[..., Campaign]


@pytest.mark.parametrize("driver", ["race.npz", "python script.py {port}"])
def test_only_a_class_has_arguments(campaign: Make, driver: str) -> None:
    with pytest.raises(SpecError, match=r"line \d+\): only a class 'FILE.py:CLASS' has arguments"):
        campaign(driver=driver, parameters={"driver.throttle": [0.5]}, samples={})


def test_all_faults_are_reported_at_once(campaign: Make, tmp_path: Path) -> None:
    with pytest.raises(SpecError) as caught:
        campaign(
            driver="pilot.py:Driver",
            parameters={
                "vehicles.V1.gripfactor": [1.0],
                "vehicles.V2.x": [0.0],
                "vehicles.V1.mass_factor": {"uniform": [0.01, 1.0]},
                "map.ground.gripp": [1.0],
                "vehicles.V1.spec.wheels.radios": [0.1],
                "latency": {"uniform": [0.0, 100.0]},
            },
            samples={"method": "sobol"},
            metrics=["distancex"],
            pass_="collisionz == 0",
            stop={"events": ["Collisionx"]},
            files=["map.png"],
            seeds=[1, 1],
        )
    text = str(caught.value)
    for part in (
        "file 'pilot.py' does not exist",
        "'gripfactor' is not a known key",
        "Did you mean 'grip_factor'?",
        "there is no 'V2' in the vehicles of the scenario. Known: V1.",
        "mass_factor (line",
        "must be at least 0.1",
        "'gripp' is not a known key",
        "Did you mean 'grip'?",
        "'radios' is not a known key",
        "must be from 0 to 10 s",
        "the method 'sobol' needs a count",
        "'distancex' is not known",
        "'collisionz' is not a metric of this campaign",
        "'Collisionx' is not an event",
        "file 'map.png' does not exist",
        "a list of different seeds",
        "short.yaml",
    ):
        assert part in text, part


@pytest.mark.parametrize("method", ["random", "latin_hypercube", "sobol"])
def test_a_method_that_draws_samples_needs_a_count(campaign: Make, method: str) -> None:
    with pytest.raises(SpecError, match=rf"samples \(line \d+\): the method '{method}' needs a count"):
        campaign(parameters={"latency": {"uniform": [0.0, 0.1]}}, samples={"method": method})


@pytest.mark.parametrize("method", ["grid", "list"])
def test_a_method_that_names_its_samples_has_no_count(campaign: Make, method: str) -> None:
    points = {"points": [{"latency": 0.1}]} if method == "list" else {}
    with pytest.raises(SpecError, match=rf"count \(line \d+\): the method '{method}' has no count"):
        campaign(parameters={"latency": [0.0, 0.1]}, samples={"method": method, "count": 2, **points})


def test_wrong_types_are_reported_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("scenario: plane\ndriver: d.py:D\nparameters:\n  latency: {uniform: [1, 0]}\nseed: 3\npasses: x\n")
    with pytest.raises(SpecError) as caught:
        Campaign.load(path)
    assert "parameters.latency (line 4): uniform: the first number must be less" in str(caught.value)
    assert "seed (line 5): 'seed' is not a known key" in str(caught.value)
    assert "passes (line 6): 'passes' is not a known key" in str(caught.value)


@pytest.mark.parametrize("method", ["random", "latin_hypercube", "sobol"])
def test_samples_are_those_of_their_method(method: Any) -> None:
    ranges = {
        "a": ParameterRange(uniform=(2.0, 4.0)),
        "b": ParameterRange(log_uniform=(0.1, 10.0)),
        "c": ParameterRange(normal=(1.0, 2.0)),
    }
    count = 100
    points = list(Design(ranges, Sampling(method=method, count=count, seed=5)))
    again = list(Design(ranges, Sampling(method=method, count=count, seed=5)))
    assert points == again
    a, b, c = (np.array([point[name] for point in points]) for name in ranges)
    assert 2.0 <= a.min() < 2.2 < 3.8 < a.max() <= 4.0
    assert np.median(np.log(b)) == pytest.approx(0.0, abs=0.6)  # half of the logarithms are below the middle
    assert np.mean(c) == pytest.approx(1.0, abs=0.8)  # four standard deviations of the mean of 100
    if method == "latin_hypercube":
        assert sorted(((a - 2.0) / 2.0 * count).astype(int)) == [*range(count)]
    if method == "sobol":
        from scipy.stats import qmc  # here and below: each worker collects this file, and the import takes a second

        expected = qmc.Sobol(3, rng=np.random.default_rng(5)).random_base2(7)[:count, 0]
        np.testing.assert_allclose((a - 2.0) / 2.0, expected, rtol=1e-12)


def test_grids_are_crossed_with_samples() -> None:
    ranges = {
        "a": ParameterRange(grid=(1, 2)),
        "b": ParameterRange(uniform=(0.0, 1.0)),
        "c": ParameterRange(grid=("x", "y", "z")),
    }
    points = list(Design(ranges, Sampling(method="random", count=4)))
    assert len(points) == 24
    assert {(point["a"], point["c"]) for point in points} == {(a, c) for a in (1, 2) for c in "xyz"}
    assert len({point["b"] for point in points}) == 4
    assert list(Design({"a": ParameterRange(choice=(1, 2)), "b": ParameterRange(choice=(3, 4))}, Sampling())) == [
        {"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}
    ]  # fmt: skip
    listed = Sampling(method="list", points=({"b": 0.5}, {"b": 0.7}))
    assert [point["b"] for point in Design({"b": ParameterRange(uniform=(0.0, 1.0))}, listed)] == [0.5, 0.7]


@pytest.mark.parametrize(
    ("text", "values", "margin"),
    [
        ("a < 0.5 and b == 0", (0.3, 0.0), 0.2),
        ("a < 0.5 and b == 0", (0.3, 2.0), -2.0),
        ("a < 0.5 or b > 1", (0.7, 3.0), 2.0),
        ("not a < 0.5", (0.3, 0.0), -0.2),
        ("0 <= a < 1", (0.3, 0.0), 0.3),
        ("max(a, b) - 2 * abs(b) / 4 >= -1", (0.5, -2.0), 0.5),
        ("a / b < 1", (1.0, 0.0), -math.inf),
        ("a < 1", (math.nan, 0.0), -math.inf),
        ("a != 1", (math.nan, 0.0), -math.inf),
    ],
)
def test_criteria_hold_when_their_margin_is_positive(text: str, values: Any, margin: float) -> None:
    expression, given = Expression(text, ["a", "b"]), dict(zip("ab", values, strict=True))
    assert expression.margin(given) == pytest.approx(margin)
    assert expression.holds(given) == (margin > 0.0)


@pytest.mark.parametrize(
    "text",
    ["a", "a < c", "__import__('os')", "a.real < 1", "a < 1 if b else 2", "[a] < 1", "a in b", "abs(a, b) < 1",
     "a < 'x'", "(lambda: a)() < 1", "a <", "min() < 1", "a ** 9 ** 9 < 1", "(" * 500 + "a",
     "a < " + 401 * "9", "a < -1e400", "a * 0x" + 400 * "f" + " < 1"],
)  # fmt: skip
def test_what_is_no_criterion_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        Expression(text, ["a", "b"])


@pytest.mark.parametrize(("count", "total"), [(0, 10), (10, 10), (3, 17), (512, 1024)])
def test_rates_have_the_interval_of_wilson(count: int, total: int) -> None:
    from scipy.stats import binomtest

    expected = binomtest(count, total).proportion_ci(0.95, "wilson")
    assert wilson(count, total) == pytest.approx((expected.low, expected.high))


def test_means_have_the_interval_of_student() -> None:
    from scipy.stats import bootstrap

    values = np.random.default_rng(0).normal(3.0, 1.0, 400)
    low, high = mean_interval(values)
    other = bootstrap((values,), np.mean, rng=np.random.default_rng(1)).confidence_interval
    assert (low, high) == pytest.approx((other.low, other.high), abs=0.02)  # a fifth of the width
    assert all(math.isnan(one) for one in mean_interval(values[:1]))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"seeds": 10**9}, "are 8000000000 runs; a campaign has at most 10000000"),
        ({"seeds": 10**30}, "a campaign has at most 10000000"),
        ({"samples": {"method": "sobol", "count": 10**9}}, "must be at most 1e.07"),
        (
            {"parameters": {f"vehicles.V1.{one}_factor": {"grid": [*range(1, 3000)]} for one in ("grip", "noise")}},
            "runs",
        ),
    ],
)
def test_huge_counts_are_refused_before_anything_is_built(campaign: Make, changes: dict[str, Any], text: str) -> None:
    tracemalloc.start()
    with pytest.raises(SpecError, match=text):
        campaign(**changes)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6  # a list of 1e9 seeds takes 8 GB


@pytest.mark.parametrize(
    ("driver", "text"),
    [
        ("class Driver(:\n    pass\n", r"SyntaxError: .*driver.py, line 1"),
        (
            "x = 1\nimport no_such_package\n",
            r"ModuleNotFoundError: No module named 'no_such_package'  \(driver.py, line 2\)",
        ),
        ("class Pilot:\n    pass\n", "driver.py has no 'Driver'"),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
        (
            "import time\ntime.sleep(1000)\n",
            r"'driver.py' was not loaded within 1 s \(the key 'time_limit'\)  \(driver.py, line 2\)",
        ),
    ],
)
@pytest.mark.parametrize(
    ("key", "value", "place"), [("driver", "driver.py:Driver", "driver"), ("metrics", ["driver.py:Driver"], "metric 1")]
)
def test_a_file_that_cannot_be_loaded_is_reported_before_the_first_run(
    campaign: Make, tmp_path: Path, driver: str, text: str, key: str, value: Any, place: str
) -> None:
    (tmp_path / "sound.py").write_text((tmp_path / "driver.py").read_text())
    (tmp_path / "driver.py").write_text(driver)
    values: dict[str, Any] = {"driver": "sound.py:Driver", "metrics": ["distance"], "pass_": "", "time_limit": 1.0}
    with pytest.raises(SpecError, match=rf"{place} \(line \d+\): .*{text}"):
        campaign(**values | {key: value})
