"""What cached contents depend on."""

from __future__ import annotations

from pathlib import Path

import pytest

from autodrive.base import cache
from autodrive.base.cache import sources
from tests.support.layers import import_graph, module_of


def test_a_compiled_function_depends_on_all_that_its_module_imports() -> None:
    """Compared with the import graph of grimp."""
    graph = import_graph()
    for path in cache.PACKAGE.rglob("*.py"):
        if not (path.parent / "__init__.py").exists():
            continue  # a program for a car, which is copied and not imported
        name = module_of(path)
        if "autodrive.base.jit" in graph.find_modules_directly_imported_by(name):
            imported = {other for other in graph.find_upstream_modules(name) if other.startswith("autodrive.")}
            imported.discard("autodrive.base.version")  # of the root, which does not count
            assert imported <= {module_of(source) for source in sources(path)}, path


@pytest.mark.parametrize(
    "text",
    [
        "from autodrive.near import value",
        "from autodrive import near",
        "import autodrive.near",
        "import math, autodrive.near as two",
        "from autodrive.pack import (\n    other,\n    near,\n)",
        "if True:\n    from autodrive.pack import near as two",
    ],
)
def test_each_form_of_an_import_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    package = tmp_path / "autodrive"
    monkeypatch.setattr(cache, "PACKAGE", package)
    (package / "pack").mkdir(parents=True)
    for name in ("near.py", "pack/near.py", "far.py"):
        (package / name).write_text("from autodrive import far\n")
    (tmp_path / "script.py").write_text(text)
    imported = {path.relative_to(tmp_path).as_posix() for path in sources(tmp_path / "script.py")}
    near = "autodrive/pack/near.py" if "pack" in text else "autodrive/near.py"
    assert imported == {"script.py", near, "autodrive/far.py"}


def test_a_module_that_is_not_imported_does_not_count() -> None:
    paths = {path.relative_to(cache.PACKAGE).as_posix() for path in sources(cache.PACKAGE / "physics" / "tick.py")}
    assert {"physics/tick.py", "physics/actuators/drivetrain.py", "physics/model.py"} <= paths
    assert {path.partition("/")[0] for path in paths} == {"base", "physics", "protocol"}
