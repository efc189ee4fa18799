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
BLOCK = re.compile(r"^```(?:[\w-]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


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


SHOWS_ROOT = "```{include} ../"
"""Beginning of a page that shows a file of the root of the repository."""


def pages() -> list[Path]:
    """The pages with a text of their own."""
    return [page for page in sorted((ROOT / "docs").glob("*.md")) if not page.read_text().startswith(SHOWS_ROOT)]


def test_each_page_begins_with_what_the_reader_can_do() -> None:
    """A sentence, not a table, a heading or a block of code."""
    assert len(pages()) > 40
    for page in pages():
        heading, empty, first = page.read_text(encoding="utf-8").splitlines()[:3]
        assert heading.startswith("# "), page.name
        assert not empty, page.name
        assert re.match(r"[A-Z][a-z]*,? \w", first.replace("`", "").replace("[", "")), f"{page.name}: {first}"


def test_each_page_is_in_the_table_of_the_readme() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Documentation\n")[2]
    linked = set(re.findall(r"\]\(docs/(\w+\.md)\)", readme))
    assert linked == {page.name for page in pages()} - {"index.md"}


def test_each_example_is_on_the_page_of_examples() -> None:
    text = (ROOT / "docs/examples.md").read_text(encoding="utf-8")
    linked = {path for path in re.findall(r"\]\(\.\./([\w/.]+)\)", text) if (ROOT / path).is_file()}
    kinds = "examples/*/*.py", "examples/*/*.yaml", "examples/*/*.ipynb", "clients/cpp/examples/*.cpp"
    assert linked == {str(path.relative_to(ROOT)) for kind in kinds for path in ROOT.glob(kind)}


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
        programs = re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
        if programs and path.stem not in NOT_ANNOTATED:
            # some imports are for the text that follows, or are in two programs; overloads of numpy are not complete
            lenient = ["reportUnusedImport", "reportDuplicateImport", "reportUnknownArgumentType"]
            rules = ", ".join(["strict", *(f"{rule}=false" for rule in lenient if path.stem != "README")])
            (tmp_path / f"{path.stem}.py").write_text(f"# pyright: {rules}\n" + "\n".join(programs))
    assert len([*tmp_path.iterdir()]) > 15
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, tmp_path],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stdout + done.stderr
