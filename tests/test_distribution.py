"""The wheels: the simulator with its page, and autodrive-client without the simulator."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import types
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import autodrive
from autodrive.base.cache import PACKAGE
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from tests.connect.client.conftest import bare
from tests.support.layers import import_graph, module_of
from tests.support.released import problems

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src/autodrive"
CLIENT = tomllib.loads((ROOT / "clients/python/pyproject.toml").read_text(encoding="utf-8"))
"""The settings of autodrive-client."""
UV = shutil.which("uv") or (str(path) if (path := ROOT / ".venv-uv/bin/uv").is_file() else None)

needs_uv = pytest.mark.skipif(UV is None, reason="uv is not on PATH")
needs_page = pytest.mark.skipif(
    not (PACKAGE / "page" / "built-from").is_file(), reason="the page is not built: scripts/page"
)


def uv(*arguments: str | Path) -> None:
    """Runs uv; its output is the message if it fails."""
    assert UV is not None
    done = subprocess.run([UV, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def built(project: Path, folder: Path) -> Path:
    """The wheel of a project, built into `folder`."""
    uv("build", "--quiet", "--wheel", "--out-dir", folder, project)
    (wheel,) = folder.glob("*.whl")
    return wheel


@needs_page
@needs_uv
@pytest.mark.process
def test_the_wheel_contains_the_page(tmp_path: Path) -> None:
    wheel = built(ROOT, tmp_path)
    with zipfile.ZipFile(wheel) as content:
        names = set(content.namelist())
        index = content.read("autodrive/page/index.html").decode()
    loaded = [part.split('"')[0] for part in index.split('="./')[1:]]
    assert any(name.endswith(".js") for name in loaded)
    assert {f"autodrive/page/{name}" for name in loaded} <= names  # all that the page loads is there
    assert list(problems(wheel, set())) == []


def hooks(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module `hatch_build`, with empty classes for those of hatchling."""
    for name, kind in (("builders.hooks", "BuildHookInterface"), ("metadata", "MetadataHookInterface")):
        interface = types.ModuleType(f"hatchling.{name}.plugin.interface")
        setattr(interface, kind, object)
        monkeypatch.setitem(sys.modules, interface.__name__, interface)
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def hook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The build hook in a tree of its own, whose `scripts/page` fails; hatchling itself is not needed."""
    made = hooks(monkeypatch).PageBuildHook()
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


def test_the_links_of_the_readme_lead_to_the_repository_when_its_address_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = hooks(monkeypatch).ReadmeHook()
    made.root = str(ROOT)
    metadata: dict[str, Any] = {"version": "1.0.0", "urls": {"Repository": "https://code.example.org/lab/simulator/"}}
    made.update(metadata)
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", metadata["readme"]["text"])
    assert len(links) > 50
    for picture, link in links:
        if not link.startswith("#"):
            start = f"https://code.example.org/lab/simulator/{'raw' if picture else 'blob'}/v1.0.0/"
            assert link.startswith(start)
            assert (ROOT / link.removeprefix(start).partition("#")[0]).exists(), link
    made.update(unknown := {"version": "1.0.0"})
    assert unknown["readme"] == {"content-type": "text/markdown", "text": (ROOT / "README.md").read_text()}  # pyright: ignore


# -- the files of a release -------------------------------------------------------------------------------------


def wheel_with(folder: Path, *names: str) -> Path:
    """A wheel with empty files of these names."""
    with zipfile.ZipFile(folder / "autodrive_simulator-1.0.0-py3-none-any.whl", "w") as archive:
        for name in names:
            archive.writestr(name, "")
    return Path(str(archive.filename))


def source_with(folder: Path, *names: str) -> Path:
    """A source distribution with empty files of these names."""
    with tarfile.open(folder / "autodrive_simulator-1.0.0.tar.gz", "w:gz") as archive:
        for name in names:
            archive.addfile(tarfile.TarInfo(f"autodrive_simulator-1.0.0/{name}"))
    return Path(str(archive.name))


def test_a_wheel_with_a_file_of_the_repository_is_refused(tmp_path: Path) -> None:
    inside = "autodrive/__init__.py", "autodrive_simulator-1.0.0.dist-info/METADATA"
    assert list(problems(wheel_with(tmp_path, *inside), set())) == []
    (problem,) = problems(wheel_with(tmp_path, *inside, "tests/conftest.py"), {"tests/conftest.py"})
    assert "contains tests/conftest.py, which is not part of the distribution" in problem


def test_a_source_distribution_with_other_files_than_those_of_the_repository_is_refused(tmp_path: Path) -> None:
    tracked = {"README.md", "web/index.html", "clients/python/hatch_build.py", ".ci/run", ".github/workflows/test.yml"}
    inside = "PKG-INFO", "README.md", "web/index.html", "src/autodrive/page/index.html", "hatch_build.py", ".gitignore"
    assert list(problems(source_with(tmp_path, *inside), tracked)) == []
    strange = ".ci/run", ".github/workflows/test.yml", "recordings/lap.mcap", "web/node_modules/three/index.js"
    found = list(problems(source_with(tmp_path, *inside, *strange), tracked))
    assert [problem.split()[2].rstrip(",") for problem in found] == list(strange)


def test_a_file_that_is_too_large_for_pypi_is_refused(tmp_path: Path) -> None:
    wheel = wheel_with(tmp_path, "autodrive/__init__.py")
    size = wheel.stat().st_size
    assert list(problems(wheel, set(), size_max=size)) == []
    (problem,) = problems(wheel, set(), size_max=size - 1)
    assert "PyPI takes at most" in problem


# -- install commands -------------------------------------------------------------------------------------------


# -- autodrive-client -------------------------------------------------------------------------------------------


def client_files() -> Iterator[Path]:
    """Python files in autodrive-client."""
    for name in CLIENT["tool"]["autodrive"]["modules"]:
        path = SOURCE / name
        assert path.exists(), f"clients/python/pyproject.toml lists {name}, which does not exist"
        yield from sorted(path.rglob("*.py")) if path.is_dir() else [path] if path.suffix == ".py" else []


def imported_at_run_time(path: Path) -> set[str]:
    """Modules and distributions that a file imports."""
    return import_graph(typing_too=False).find_modules_directly_imported_by(module_of(path))


def test_the_client_distribution_contains_all_that_it_imports() -> None:
    parts = [name.removesuffix(".py").replace("/", ".") for name in CLIENT["tool"]["autodrive"]["modules"]]
    modules = tuple(f"autodrive.{name}." for name in [*parts, *autodrive.__all__])
    for path in client_files():
        missing = {
            name
            for name in imported_at_run_time(path)
            if name.startswith("autodrive.") and not f"{name}.".startswith(modules)
        }
        assert not missing, f"{path.relative_to(SOURCE)} imports {missing}: add them to clients/python/pyproject.toml"


def test_the_client_distribution_requires_all_that_it_imports() -> None:
    required = {
        re.split(r"[<>=~]", requirement)[0].replace("-", "_") for requirement in CLIENT["project"]["dependencies"]
    }
    optional = {"numba"}  # transforms.py compiles its functions if it is installed
    for path in client_files():
        packages = {name.split(".")[0] for name in imported_at_run_time(path)} - sys.stdlib_module_names - {"autodrive"}
        assert packages <= required | optional, path.relative_to(SOURCE)


def test_the_client_distribution_requires_no_more_than_the_simulator() -> None:
    simulator = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    names = {re.split(r"[<>=~ ]", requirement)[0] for requirement in simulator}
    assert {re.split(r"[<>=~]", requirement)[0] for requirement in CLIENT["project"]["dependencies"]} <= names


TRY_CLIENT = """
import importlib, importlib.util, pkgutil, sys, types
sys.modules["gymnasium"] = types.ModuleType("gymnasium")  # the client has no environments to register
import autodrive

for name in sys.argv[2:]:
    module = importlib.import_module("autodrive." + name)
    for sub in pkgutil.iter_modules(getattr(module, "__path__", [])):
        importlib.import_module(f"autodrive.{name}.{sub.name}")
print("found:", *(name for name in ("mujoco", "numba", "moderngl", "uvicorn") if importlib.util.find_spec(name)))
with autodrive.Client(sys.argv[1]) as sim, sim.lockstep():
    print("time:", sim.step({"V1": autodrive.Command(throttle=1.0)}).time)
try:
    autodrive.make
except ImportError as error:
    print("make:", error)
"""


@needs_uv
@pytest.mark.process
def test_the_client_distribution_drives_a_simulator_from_a_clean_environment(tmp_path: Path) -> None:
    environment = tmp_path / "environment"
    uv("venv", "--quiet", "--python", sys.executable, environment)
    (python,) = environment.glob("[bS]*/python*" if sys.platform == "win32" else "bin/python")
    uv("pip", "install", "--quiet", "--python", python, built(ROOT / "clients/python", tmp_path))
    listed = [name for name in CLIENT["tool"]["autodrive"]["modules"] if not name.endswith(("__.py", ".typed", ".pyi"))]
    modules = [name.removesuffix(".py").replace("/", ".") for name in listed]
    with (
        autodrive.Simulation(autodrive.make("plane")) as simulation,
        SimulationServer(Served(simulation, bare), PageOptions(port=0)) as server,
    ):
        done = subprocess.run(
            [python, "-I", "-c", TRY_CLIENT, server.url, *modules],
            capture_output=True, text=True, check=False, cwd=tmp_path,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found, time, make = done.stdout.splitlines()
    assert found == "found:"
    assert float(time.removeprefix("time:")) > 0.0
    assert "autodrive-simulator" in make


def test_the_packages_for_ros_and_cpp_have_the_version_of_the_simulator() -> None:
    stated = {
        "clients/cpp/CMakeLists.txt": r"^project\(autodrive VERSION (\S+)",
        "ros/ros2/autodrive_ros2/setup.py": r'^    version="(.+)"',
        **{str(path.relative_to(ROOT)): r"^  <version>(.+)</version>" for path in ROOT.glob("ros/**/package.xml")},
    }
    versions = {
        file: re.findall(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
        for file, pattern in stated.items()
    }
    assert versions == {file: [autodrive.__version__] for file in stated}
    assert f"\n## [{autodrive.__version__}] - 20" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
