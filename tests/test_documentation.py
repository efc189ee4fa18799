"""Links and blocks of code in all Markdown files, and the documentation site."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.waiting import LIMIT

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted(
    path
    for path in [
        *ROOT.glob("*.md"),
        *(p for d in ("docs", "ros", "clients", "examples") for p in (ROOT / d).rglob("*.md")),
    ]
    if "node_modules" not in path.parts
)
BLOCK = re.compile(r"^```([\w-]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)

RUN_BY = {
    "adding_a_sensor.md": {"python": "tests/test_adding_a_sensor.py", "yaml": "tests/test_adding_a_sensor.py"},
    "README.md": {"python": "tests/test_readme.py", "yaml": "tests/test_readme.py"},
    "client.md": {"python": "tests/connect/client/test_document.py"},
    "first_drive.md": {"python": "tests/connect/devkit/test_python_examples.py"},
    "cpp.md": {"cpp": "tests/clients/test_cpp_docs.py", "cmake": "tests/clients/test_cpp_docs.py"},
    "proxy.md": {"nginx": "tests/page/test_proxy.py"},
    "racing.md": {
        "python": "tests/world/racing/test_race_document.py",
        "yaml": "tests/world/racing/test_race_document.py",
    },
    "learning_to_race.md": {"python": "tests/test_docs.py"},
    "own_task.md": {"python": "tests/experiments/envs/test_own_task.py"},
    "learning.md": {"python": "tests/experiments/envs/test_document.py"},
    "protocol.md": {"json": "tests/protocol/test_native.py"},
    "python.md": {"python": "tests/connect/devkit/test_python_docs.py"},
    "ros1.md": {"python": "tests/connect/ros/test_ros1.py"},
    "ros2.md": {"python": "tests/connect/ros/test_ros2.py", "yaml": "tests/connect/ros/test_ros2_files.py"},
    "campaigns.md": {
        "python": "tests/experiments/campaigns/test_campaign_document.py",
        "yaml": "tests/experiments/campaigns/test_campaign_document.py",
    },
    "batch.md": {"python": "tests/world/batch/test_batch_world.py"},
    "identification.md": {"python": "tests/experiments/identification/test_identification.py"},
    "recordings.md": {"python": "tests/recording/test_document.py"},
    "race_car.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "scenarios.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "tracks.md": {"python": "tests/scenario/tracks/test_document.py", "yaml": "tests/scenario/tracks/test_document.py"},
    "drawing.md": {"python": "tests/test_docs.py"},
    "traffic.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "traffic_lights.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "v2x.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "weather.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
    "vehicle.md": {"python": "tests/test_docs.py", "yaml": "tests/test_docs.py"},
}
"""Document -> language of its blocks -> the test that runs them. tests/test_commands.py has those for a shell."""

NOT_RUN = {"text", ""}
"""Languages of blocks that show output."""


def blocks(path: Path) -> list[tuple[str, str]]:
    """Language and text of every block, without those that only the site reads."""
    found = BLOCK.findall(path.read_text(encoding="utf-8"))
    return [(language, text) for language, text in found if language not in NOT_RUN]


def anchors(path: Path) -> set[str]:
    """Anchors of the headings, as code hosts and the site make them."""
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def test_links_lead_to_files_and_headings() -> None:
    wrong: list[str] = []
    for path in DOCUMENTS:
        text = BLOCK.sub("", path.read_text(encoding="utf-8"))
        for link in re.findall(r"\]\((?!https?://|mailto:)([^)\s]+)\)", text):
            file, _, anchor = link.partition("#")
            target = (path.parent / file).resolve() if file else path
            is_there = target.exists() and (not anchor or target.suffix != ".md" or anchor in anchors(target))
            if not is_there:
                wrong.append(f"{path.relative_to(ROOT)}: {link}")
    assert wrong == []


def test_every_block_of_code_is_run_by_a_test() -> None:
    for path in DOCUMENTS:
        for language in {language for language, _ in blocks(path)} - {"sh"}:
            if path.parent.name == "devkit" or path.parts[-2] == "cpp":  # READMEs that repeat what docs/ shows
                continue
            test = RUN_BY.get(path.name, {}).get(language)
            assert test is not None, f"no test runs the {language} of {path.relative_to(ROOT)}"
            assert path.stem in (ROOT / test).read_text(encoding="utf-8"), f"{test} does not name {path.name}"


@pytest.mark.slow
@pytest.mark.process
def test_the_site_builds_without_warnings_and_names_all_that_is_public(tmp_path: Path) -> None:
    import autodrive

    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", tmp_path / "doctrees"]
    # every page has a tree of all pages: with each name of the API in it, it takes a third of the time
    command += ["-D", "toc_object_entries=0", "docs", tmp_path / "site"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    api = (tmp_path / "site" / "api.html").read_text(encoding="utf-8")
    missing = [name for name in autodrive.__all__ if not re.search(rf'id="autodrive[\w.]*\.{name}"', api)]
    assert missing == []
    assert (tmp_path / "site" / "searchindex.js").is_file()


NOT_ANNOTATED = {"adding_a_sensor", "campaigns", "learning", "own_task", "ros1", "ros2"}
"""Documents whose programs define functions without annotations, or use packages without types."""


@pytest.mark.slow
@pytest.mark.process
def test_the_programs_pass_a_strict_type_checker(tmp_path: Path) -> None:
    """The types of what they use are known, so that editors complete names and check programs of users."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        programs = [code for language, code in blocks(path) if language == "python"]
        if programs and path.stem not in NOT_ANNOTATED:
            # some imports are for the text that follows; the overloads of numpy are not complete
            rules = "" if path.stem == "README" else ", reportUnusedImport=false, reportUnknownArgumentType=false"
            (tmp_path / f"{path.stem}.py").write_text(f"# pyright: strict{rules}\n" + "\n".join(programs))
    assert len([*tmp_path.iterdir()]) > 15
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, tmp_path],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stdout + done.stderr
