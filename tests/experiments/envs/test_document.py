"""The programs of docs/learning.md run, and the page names the settings and features of the code."""

from __future__ import annotations

import io
import re
import runpy
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.registration import IDS, ROBORACER, ROBORACER_STEPS, SEVERAL_CARS
from autodrive.experiments.envs.settings import TASKS

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/learning.md").read_text(encoding="utf-8")


def test_the_programs_of_the_page_run() -> None:
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        with redirect_stdout(io.StringIO()):
            exec(code, names)
    assert names["observations"].shape == (8, 60)  # of the last one, four races of two cars


def test_the_page_names_every_id_and_its_steps() -> None:
    known = {id_: steps for id_, (_, steps) in (*IDS.items(), *SEVERAL_CARS.items())} | {ROBORACER: ROBORACER_STEPS}
    for id_, steps in known.items():
        assert re.search(rf"`{id_}`.* \| {steps} steps", PAGE)


def test_the_page_names_every_feature_or_the_first_of_its_kind() -> None:
    for task in TASKS.values():
        made = task(5)
        for observation in ("state", "lidar"):
            for feature in observed(made, observation):
                first = re.sub(r"box_\d", "box_1", re.sub(r"range_-?[\d.]+", "range_0", feature.name))
                first = re.sub(r"ahead_(0\.8|0\.5|1|2|4)_", "ahead_0.2_", first).replace("0.4_y", "0.2_y")
                assert f"`{first}`" in PAGE, feature.name


def test_the_example_drives_a_lap() -> None:
    output = io.StringIO()
    with redirect_stdout(output):
        runpy.run_path(str(ROOT / "examples/python/7_gymnasium.py"))
    found = re.fullmatch(r"lap complete, reward (\d+\.\d) m\n", output.getvalue())
    assert found, output.getvalue()
    assert 17.0 < float(found[1]) < 18.6  # the lap is 18.54 m long
