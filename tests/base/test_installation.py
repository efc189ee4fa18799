"""A mixed or incomplete installation of MuJoCo is recognised, with the command that fixes it."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

import autodrive
from autodrive.base import installation
from autodrive.base.cache import cache_folder, home_cache
from autodrive.cli import doctor
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.physics import engine
from autodrive.scenario.maps.solids import fixed_shapes
from tests.connect.client.conftest import bare

ROOT = Path(__file__).parents[2]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Fakes an environment: versions of distributions, and names of the files in the folder `mujoco`."""

    def fake(*files: str, **versions: str) -> None:
        def version(name: str) -> str:
            if name not in found:
                raise importlib.metadata.PackageNotFoundError(name)
            return found[name]

        found = {name.replace("_", "-"): version for name, version in versions.items()}
        folder = tmp_path / "mujoco"
        folder.mkdir()
        for name in files:
            (folder / name).touch()
        origin = str(folder / "__init__.py") if "__init__.py" in files else None
        monkeypatch.setattr(importlib.metadata, "version", version)
        monkeypatch.setattr(
            importlib.util, "find_spec", lambda name: ModuleSpec(name, None, origin=origin) if files else None
        )

    return fake


WHOLE = ("__init__.py", "libmujoco.so.4.0.1")


@pytest.mark.parametrize("files", [WHOLE, ("__init__.py", "libmujoco.4.0.1.dylib"), ("__init__.py", "mujoco.dll")])
@pytest.mark.parametrize("also", [{}, {"mujoco": "4.0.1"}])
def test_a_whole_installation_has_no_error(install, files: tuple[str, ...], also: dict[str, str]) -> None:
    install(*files, mujoco_core="4.0.1", **also)
    assert installation.mujoco_error() == ""


@pytest.mark.parametrize(
    ("files", "versions", "error"),
    [
        ((), {"mujoco": "3.17.0"}, "mujoco 3.17.0 is installed, but the simulator needs mujoco-core>=4"),
        (
            (*WHOLE, "libmujoco.so.3.17.0"),
            {"mujoco": "3.17.0", "mujoco_core": "4.0.1"},
            "mujoco 3.17.0 and mujoco-core 4.0.1 are both installed, and one has overwritten files of the other",
        ),
        (WHOLE, {"mujoco": "4.0.0", "mujoco_core": "4.0.1"}, "mujoco 4.0.0 and mujoco-core 4.0.1 are both installed"),
        (("libmujoco.so.4.0.1",), {"mujoco_core": "4.0.1"}, "files of mujoco-core 4.0.1 are missing"),
        ((), {"mujoco_core": "4.0.1"}, "files of mujoco-core 4.0.1 are missing"),
        (
            ("__init__.py", "libmujoco.so.3.17.0"),
            {"mujoco_core": "4.0.1"},
            "mujoco-core 4.0.1 is installed, but its files are of version 3.17.0",
        ),
    ],
)
def test_a_mixed_or_incomplete_installation_is_recognised(
    install, files: tuple[str, ...], versions: dict[str, str], error: str
) -> None:
    install(*files, **versions)
    assert installation.mujoco_error().startswith(error)
    (check,) = [doctor.package("mujoco-core", "mujoco-core>=4")]
    assert (check.is_ok, check.text) == (False, installation.mujoco_error())
    names = " ".join(name.replace("_", "-") for name in versions)
    assert f" {names} && " in check.fix
    assert check.fix.endswith(f"'{installation.MUJOCO}'")


def test_the_fix_requires_what_the_project_requires() -> None:
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    assert installation.MUJOCO in dependencies


@pytest.mark.process
def test_a_mixed_installation_is_refused_at_start_in_one_line(tmp_path: Path) -> None:
    other = tmp_path / "mujoco-3.17.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: mujoco\nVersion: 3.17.0\n")
    done = subprocess.run(
        [Path(sys.executable).with_name("autodrive"), "run", "plane", "--headless"],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 2
    # a start that takes seconds, on a loaded machine, says so
    (line,) = [one for one in done.stderr.splitlines() if not one.startswith("starting the simulator, ")]
    assert "mujoco 3.17.0 and mujoco-core" in line
    assert "uninstall" in line


def test_mujoco_4_0_0_solves_with_dense_jacobians(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = "<geom type='plane' size='1 1 1'/>"
    mjcf = f"<mujoco><worldbody>{floor}<body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    dense = engine.mujoco.mjtJacobian.mjJAC_DENSE  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setattr(engine, "VERSION", "4.0.1")
    assert engine.Engine(mjcf, fixed_shapes(())).model.opt.jacobian != dense
    monkeypatch.setattr(engine, "VERSION", "4.0.0")
    assert engine.Engine(mjcf, fixed_shapes(())).model.opt.jacobian == dense


def test_doctor_checks_the_packages_of_this_platform_only(monkeypatch: pytest.MonkeyPatch) -> None:
    requires = ["numpy>=2.2", "uvloop>=0.22; sys_platform == 'no such platform'", "nothing; extra == 'maps'"]
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: requires)
    assert [check.subject for check in doctor.packages()] == ["numpy"]


@pytest.mark.process
def test_without_moderngl_all_but_the_cameras_works() -> None:
    code = """
import sys
sys.modules["moderngl"] = None
import autodrive
print(autodrive.make("plane").step().time)
try:
    autodrive.make("plane", cameras=True)
except autodrive.GlUnavailable as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    time, error = done.stdout.splitlines()
    assert float(time) > 0.0
    assert error.startswith("cameras are unavailable")
    assert "pip install moderngl" in error


@pytest.mark.parametrize(
    ("system", "variables", "folder"),
    [
        ("linux", {}, "~/.cache"),
        ("linux", {"XDG_CACHE_HOME": "/scratch"}, "/scratch"),
        ("darwin", {"XDG_CACHE_HOME": "/scratch"}, "~/Library/Caches"),
        ("win32", {}, "~/AppData/Local"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local"),
    ],
)
def test_the_cache_folder_is_that_of_the_operating_system(
    monkeypatch: pytest.MonkeyPatch, system: str, variables: dict[str, str], folder: str
) -> None:
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", system)
    assert home_cache() == Path(folder).expanduser() / "autodrive"


def test_the_cache_is_among_the_temporary_files_where_there_is_no_home_to_write(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file where the cache should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder("numba").parent
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)  # anybody could have written code into it
    assert cache_folder("numba").parent == blocked / "autodrive"


def test_the_server_runs_without_uvloop(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows."""
    monkeypatch.setitem(sys.modules, "uvloop", None)
    with (
        autodrive.Simulation(autodrive.make("plane")) as simulation,
        SimulationServer(Served(simulation, bare), PageOptions(port=0)) as server,
        autodrive.Client(server.url) as client,
    ):
        assert client.frame.vehicles.keys() == {"V1"}


@pytest.mark.parametrize(
    ("noted", "requirement"),
    [
        ({"url": "file:///home/a%20b/sim", "dir_info": {"editable": True}}, "--editable '/home/a b/sim[film]'"),
        ({"url": "file:///sim", "dir_info": {}}, "'/sim[film]'"),
        (
            {"url": "https://example.org/sim", "vcs_info": {"vcs": "git", "commit_id": "12ab"}},
            "'autodrive-simulator[film] @ git+https://example.org/sim@12ab'",
        ),
        (
            {"url": "https://example.org/sim.whl", "archive_info": {}},
            "'autodrive-simulator[film] @ https://example.org/sim.whl'",
        ),
        ({}, "'autodrive-simulator[film]'"),
    ],
)
def test_an_extra_comes_from_where_the_package_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, noted: dict[str, object], requirement: str
) -> None:
    metadata = tmp_path / "autodrive_simulator-0.1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: autodrive-simulator\nVersion: 0.1.0\n")
    if noted:
        (metadata / "direct_url.json").write_text(json.dumps(noted))
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    monkeypatch.setattr(installation, "checkout", lambda: None)
    assert installation.install_extra("film") == f"{installation.pip('install')} {requirement}"
    assert installation.missing("av", "film").startswith(
        "av is not installed: it is in the extra 'film'. Install it:  "
    )
