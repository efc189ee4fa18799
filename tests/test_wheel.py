"""The wheel that people install holds the built page; an editable install builds nothing."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import types
import zipfile
from pathlib import Path
from typing import Any

import pytest

from autodrive.app import PAGE

ROOT = Path(__file__).parents[1]
UV = shutil.which("uv") or (str(path) if (path := ROOT / ".venv-uv/bin/uv").is_file() else None)

needs_page = pytest.mark.skipif(not (PAGE / "built-from").is_file(), reason="the page is not built: scripts/page")


@needs_page
@pytest.mark.skipif(UV is None, reason="uv is not on PATH")
def test_the_wheel_holds_the_page(tmp_path: Path) -> None:
    assert UV is not None
    done = subprocess.run(
        [UV, "build", "--wheel", "--out-dir", str(tmp_path), str(ROOT)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        names = set(content.namelist())
        index = content.read("autodrive/page/index.html").decode()
    loaded = [part.split('"')[0] for part in index.split('="./')[1:]]
    assert any(name.endswith(".js") for name in loaded)
    assert {f"autodrive/page/{name}" for name in loaded} <= names  # all that the page loads is there
    assert not any("node_modules" in name for name in names)


@pytest.fixture
def hook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The build hook in a tree of its own, whose `scripts/page` fails; hatchling itself is not needed."""
    interface = types.ModuleType("hatchling.builders.hooks.plugin.interface")
    interface.BuildHookInterface = object  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setitem(sys.modules, interface.__name__, interface)
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.PageBuildHook()
    made.root = str(tmp_path)
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts/page").write_text("touch was-asked\nexit 1\n")
    monkeypatch.chdir(tmp_path)
    return made


def test_a_wheel_without_its_page_is_not_built(hook: Any) -> None:
    with pytest.raises(SystemExit, match="the page could not be built"):
        hook.initialize("standard", {})


def test_an_editable_install_builds_no_page(hook: Any) -> None:
    hook.initialize("editable", {})
    assert not Path(hook.root, "was-asked").exists()
