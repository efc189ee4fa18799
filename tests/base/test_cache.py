"""What cached contents depend on."""

from __future__ import annotations

from pathlib import Path

import pytest

from autodrive.base import cache
from autodrive.base.cache import sources
from tests.support.layers import files, import_graph, module_of


def test_a_compiled_function_depends_on_all_that_its_module_imports() -> None:
    """Compared with the syntax trees of all modules."""
    graph = import_graph()
    for path in files():
        if "autodrive.base.jit" not in graph[module_of(path)]:
            continue
        found, pending = {module_of(path)}, [module_of(path)]
        while pending:
            new = graph[pending.pop()] - found
            found |= new
            pending += new
        assert found <= {module_of(one) for one in sources(path)}, path


@pytest.mark.parametrize(
    "text",
    [
        "from autodrive.one import value",
        "from autodrive import one",
        "import autodrive.one",
        "import math, autodrive.one as two",
        "from autodrive.pack import (\n    other,\n    one,\n)",
        "if True:\n    from autodrive.pack import one as two",
    ],
)
def test_each_form_of_an_import_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    package = tmp_path / "autodrive"
    monkeypatch.setattr(cache, "PACKAGE", package)
    (package / "pack").mkdir(parents=True)
    for name in ("one.py", "pack/one.py", "far.py"):
        (package / name).write_text("from autodrive import far\n")
    (tmp_path / "script.py").write_text(text)
    found = {path.relative_to(tmp_path).as_posix() for path in sources(tmp_path / "script.py")}
    one = "autodrive/pack/one.py" if "pack" in text else "autodrive/one.py"
    assert found == {"script.py", one, "autodrive/far.py"}


def test_a_module_that_is_not_imported_does_not_count() -> None:
    paths = {path.relative_to(cache.PACKAGE).as_posix() for path in sources(cache.PACKAGE / "physics" / "tick.py")}
    assert {"physics/tick.py", "physics/actuators/drivetrain.py", "physics/model.py"} <= paths
    assert {path.partition("/")[0] for path in paths} == {"base", "physics", "protocol"}
