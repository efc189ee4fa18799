"""The ids are known to Gymnasium whichever is imported first, and cost nothing where Gymnasium is not imported."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import pytest

from autodrive.experiments.envs.registration import IDS, ROBORACER, ROBORACER_STEPS, SEVERAL_CARS

IMPORTS = (
    "import gymnasium",
    "import autodrive, gymnasium",
    "import gymnasium, autodrive",
    "import autodrive.base.errors; autodrive.Command(); import gymnasium.vector",
)


@pytest.mark.process
@pytest.mark.parametrize("imports", IMPORTS)
def test_the_ids_are_known_in_every_order_of_imports(imports: str) -> None:
    code = f"""
import importlib, sys
{imports}
importlib.import_module("autodrive")  # as gymnasium.make("autodrive:...") does
print([id_ for id_ in gymnasium.registry if id_.startswith(("Nigel", "RoboRacer"))])
print([type(one).__name__ for one in sys.meta_path if type(one).__module__ == "autodrive"])
"""
    assert run(code) == f"{[*IDS, ROBORACER, *SEVERAL_CARS]}\n[]"


ENVS = ("", ".envs", ".envs.registration")
WITHOUT_GYMNASIUM = """
import importlib.util, sys, autodrive
sys.path[:] = [path for path in sys.path if "site-packages" not in path]
print(importlib.util.find_spec("gymnasium"))
try:
    import gymnasium
except ModuleNotFoundError as error:
    print(error)
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("code", "printed"),
    [
        pytest.param(
            "import sys, autodrive; autodrive.load_scenario; print('gymnasium' in sys.modules)",
            "False",
            id="we do not import gymnasium",
        ),
        pytest.param(
            "import sys, gymnasium, autodrive; print([n for n in sys.modules if n.startswith('autodrive.')])",
            f"{[f'autodrive.{one}' for one in ('base', 'base.version', *(f'experiments{of}' for of in ENVS))]}",
            id="registration imports nothing of the simulator",
        ),
        pytest.param(WITHOUT_GYMNASIUM, "None\nNo module named 'gymnasium'", id="without gymnasium it fails as always"),
    ],
)
def test_an_import_does_no_more_than_it_must(code: str, printed: str) -> None:
    assert run(code) == printed


def test_every_id_names_an_environment_and_its_steps() -> None:
    for id_, (task, steps) in IDS.items():
        spec = gymnasium.spec(id_)
        assert (spec.kwargs["task"], spec.max_episode_steps) == (task, steps)
    assert gymnasium.spec(ROBORACER).max_episode_steps == ROBORACER_STEPS


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
