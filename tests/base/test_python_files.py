"""Python files of the user: modules apart for each folder, read again when they change, and which files they import."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from autodrive.base.python_files import copied, load, opaque, script_files, sources


@pytest.fixture(autouse=True)
def _paths() -> Iterator[None]:
    before = [*sys.path]
    yield
    sys.path[:] = before


def write(folder: Path, **texts: str) -> Path:
    """Write files with these names and texts; the first one. '_in_' parts folders; PACKAGE is '__init__'."""
    names = (name.replace("_in_", "/").replace("PACKAGE", "__init__") for name in texts)
    paths = [folder / f"{name}.py" for name in names]
    for path, text in zip(paths, texts.values(), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="latin-1")
    return paths[0]


def found(file: Path, folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in sources(file)}


IMPORTS = {
    "a list": "import math, route\n",
    "a continued line": "from \\\n    route import value\n",
    "brackets": "from pack import (\n    route,\n    far as near,\n)\n",
    "in a function": "def f():\n    import route\n",
    "by name": "import importlib\nr = importlib.import_module('route')\n",
    "after a condition": "if True: import route\n",
    "relative": "from . import route\n",
    "a path": "import sys\nfrom pathlib import Path\nsys.path.append(str(Path(__file__).parent / 'lib'))\nimport far\n",
}


@pytest.mark.parametrize("is_loaded", [False, True])
@pytest.mark.parametrize("way", IMPORTS)
def test_each_form_of_an_import_is_found(tmp_path: Path, way: str, is_loaded: bool) -> None:
    text = f"{IMPORTS[way]}x = 1  # \xe9\n" if not is_loaded else f"{IMPORTS[way]}x = 1\n"
    helpers = {"pack_in_PACKAGE": "", "pack_in_route": "from .far import x\n", "pack_in_far": "x = 0\n"}
    file = write(tmp_path, driver=text, route="value = 3\n", unused="", lib_in_far="", **helpers)
    if is_loaded:
        assert load(file, "x") == 1
    expected = {"brackets": {"pack/__init__.py", "pack/route.py", "pack/far.py"}, "a path": {"lib/far.py"}}
    assert found(file, tmp_path) == {"driver.py", *expected.get(way, {"route.py"})}


def test_a_module_whose_name_only_running_the_file_tells_is_found(tmp_path: Path) -> None:
    text = "import importlib\nr = importlib.import_module('ro' + 'ute')\n"
    by_path = (
        "import importlib.util as u, os\ns = u.spec_from_file_location('z', os.path.dirname(__file__) + '/z.py')\n"
    )
    by_path += "z = u.module_from_spec(s)\ns.loader.exec_module(z)\n"
    file = write(tmp_path, driver=text + by_path, route="import far\n", far="", z="")
    assert opaque(file.name, file.read_bytes()) == [
        "driver.py, line 2: import_module",
        "driver.py, line 4: spec_from_file_location",
    ]
    assert found(file, tmp_path) == {"driver.py"}
    load(file, "r")
    assert found(file, tmp_path) == {"driver.py", "route.py", "far.py", "z.py"}


def test_a_package_in_the_path_of_the_user_is_found_but_no_installed_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An editable installation adds its folder to the path."""
    file = write(tmp_path, app_in_driver="import mine.part, numpy, yaml, autodrive\nx = mine.part.x\n")
    write(
        tmp_path,
        src_in_mine_in_PACKAGE="",
        src_in_mine_in_part="from mine import other\nx = other.x\n",
        src_in_mine_in_other="x = 1",
    )
    monkeypatch.syspath_prepend(str(tmp_path / "src"))
    expected = {"app/driver.py", "src/mine/__init__.py", "src/mine/part.py", "src/mine/other.py"}
    assert found(file, tmp_path) == expected
    assert load(file, "x") == 1
    assert found(file, tmp_path) == expected
    import mine.other  # pyright: ignore[reportMissingImports]  as a notebook does; the driver has modules of its own

    write(tmp_path, src_in_mine_in_other="x = 2")
    assert load(file, "x") == 2
    assert mine.other.x == 1


def test_an_edited_module_is_read_again_with_those_that_import_it(tmp_path: Path) -> None:
    file = write(tmp_path, driver="import route\nx = route.x\n", route="from far import x\n", far="x = 1\n")
    assert load(file, "x") == 1
    assert load(file, "route") is load(file, "route")
    write(tmp_path, far="x = 2\n")
    assert load(file, "x") == 2
    (tmp_path / "far.py").unlink()
    with pytest.raises(ModuleNotFoundError, match="No module named 'far'"):
        load(file, "x")


def test_installed_packages_are_not_replaced_by_files_of_their_name(tmp_path: Path) -> None:
    file = write(tmp_path, driver="import numpy, json\nx = numpy.pi\ny = json.dumps\n", numpy="", json="")
    assert load(file, "x") > 3
    assert found(file, tmp_path) == {"driver.py"}


def test_a_copy_imports_copies(tmp_path: Path) -> None:
    original, copy = tmp_path / "original", tmp_path / "copy"
    for folder, value in ((original, 1), (copy, 2)):
        write(folder, app_in_driver="from far import x\n", lib_in_far=f"x = {value}\n")
    sys.path.append(str(original / "lib"))
    assert load(original / "app" / "driver.py", "x") == 1
    with copied(original, copy):
        assert load(copy / "app" / "driver.py", "x") == 2
    assert not [path for path in sys.path if path.startswith(str(copy))]


def test_the_files_of_a_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules that `-m` names and what shell scripts name, too; no programs such as a Python."""
    write(
        tmp_path,
        drive="import far\n",
        far="",
        team_in_PACKAGE="",
        team_in_driver="from . import gain\nimport far\n",
        team_in_gain="",
        bot_in_PACKAGE="",
        bot_in___main__="import bot.part",
        bot_in_part="",
        shell_in_near="",
    )
    data, venv = tmp_path / "route.csv", tmp_path / "venv" / "bin"
    venv.mkdir(parents=True)
    (venv / "python3").symlink_to(sys.executable)
    data.write_text("drive.py")
    (tmp_path / "program").write_text("#!/usr/bin/env python3\nimport far\n")
    (tmp_path / "shell" / "start.sh").write_text('exec python "$(dirname "$0")"/near.py $1 > log.txt\n')
    (tmp_path / "start.sh").write_text("# the drive\ncd shell && . ./start.sh; python3 -m bot $PORT; ${X}/drive.py")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:/usr/bin")

    def of(command: str) -> list[str]:
        return [path.relative_to(tmp_path).as_posix() for path in script_files(command, tmp_path)]

    assert of("python drive.py {port} route.csv none.csv") == ["drive.py", "route.csv", "far.py"]
    assert (
        of("venv/bin/python3 -u drive.py {port}") == of(f"{sys.executable} drive.py {{port}}") == ["drive.py", "far.py"]
    )
    assert of("./program {port}") == ["program", "far.py"]
    team = ["far.py", "team/__init__.py", "team/driver.py", "team/gain.py"]
    assert of("python -m team.driver {port}") == of("sh -c 'python -m team.driver {port}'") == team
    assert of("python -m bot") == ["bot/__init__.py", "bot/__main__.py", "bot/part.py"]
    assert of("python -m http.server {port}") == of("ros2 launch bridge") == []
    assert of("sh start.sh {port}") == [
        *("start.sh", "bot/__init__.py", "bot/__main__.py", "bot/part.py"),
        *("drive.py", "far.py", "shell/near.py", "shell/start.sh"),
    ]
