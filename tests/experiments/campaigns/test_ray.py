"""Campaigns on a real Ray cluster of several nodes, one of which is killed."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from autodrive.base.errors import AutodriveError
from autodrive.experiments.campaigns import Campaign, CampaignObserver, run_campaign
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.ray_executor import RayExecutor
from autodrive.experiments.campaigns.runner import Runner
from autodrive.experiments.campaigns.runs import CampaignProgress
from tests.support.command_line import AUTODRIVE, refused
from tests.support.waiting import LIMIT, free_port, wait_until

Make = Callable[..., Campaign]

# Of each pair of runs the second one waits for the gate. Its parent is the actor, whose parent is Ray's node.
GATE = """
import gate
from ungated import Driver as Plain


class Driver(Plain):
    def reset(self, scene):
        if scene.scenario.seed == 1:
            gate.wait()
"""
WAIT = """
import os, pathlib, time


def wait():
    folder = pathlib.Path(pathlib.Path("folder.txt").read_text())  # beside the campaign, in the working directory
    (folder / f"waits-{os.getpid()}").touch()
    while not (folder / "open").exists():
        time.sleep(0.05)
"""


@pytest.fixture(autouse=True, scope="module")
def _path() -> Iterator[None]:
    """Importing Ray adds a folder with packages of its own, which are not those of the project for other tests."""
    before = [*sys.path]
    yield
    sys.path[:] = before


def patient(start: Callable[[], Any]) -> Any:
    """What `start` returns: Ray gives a node 30 s to start, which a busy machine may exceed."""
    for _ in range(6):
        with contextlib.suppress(Exception):
            return start()
    return start()


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A head without processors for runs, and three nodes with one each."""
    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    monkeypatch.setenv("RAY_prestart_worker_first_driver", "0")
    from ray.cluster_utils import Cluster

    small = {"object_store_memory": 80 * 2**20, "include_dashboard": False}
    cluster = patient(lambda: Cluster(True, head_node_args={"num_cpus": 0, **small}))
    nodes = [patient(lambda: cluster.add_node(wait=False, num_cpus=1, **small)) for _ in range(3)]
    cluster.wait_for_nodes(timeout=LIMIT)
    yield cluster, nodes
    cluster.shutdown()


@pytest.mark.slow
@pytest.mark.process
def test_a_node_is_killed_and_nothing_is_lost_or_twice(campaign: Make, tmp_path: Path, cluster: Any) -> None:
    the_cluster, nodes = cluster
    (tmp_path / "gated.py").write_text(GATE)
    (tmp_path / "gate.py").write_text(WAIT)
    # Under a name of its own: other tests in this process have left folders with a driver.py in the module path.
    (tmp_path / "ungated.py").write_text((tmp_path / "driver.py").read_text())
    (tmp_path / "folder.txt").write_text(str(tmp_path))
    one = campaign(driver="gated.py:Driver", files=["folder.txt"], record="failures", pass_="distance > 0.1")
    there, messages = tmp_path / "there", (tmp_path / "messages").open("w")
    command = [
        *AUTODRIVE,
        "campaign",
        str(one.path),
        "--ray",
        the_cluster.address,
        "--output",
        str(there),
        "--no-cache",
    ]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=messages, stderr=messages)
    try:
        # Three runs wait, one on each node, when a node is killed with its actor: its run is lost.
        wait_until(lambda: len(list(tmp_path.glob("waits-*"))) == 3 or process.poll() is not None)
        assert process.poll() is None, (tmp_path / "messages").read_text()
        the_cluster.remove_node(nodes[1], allow_graceful=False)
        (tmp_path / "open").touch()
        assert process.wait(LIMIT) == 0, (tmp_path / "messages").read_text()
    finally:
        process.kill()
        process.wait()
        messages.close()
    with contextlib.chdir(tmp_path):
        here = run_campaign(one, tmp_path / "here", workers=0, uses_cache=False)
    assert (there / "table.parquet").read_bytes() == here.table.read_bytes()
    names = [sorted(path.name for path in (one / "recordings").glob("*")) for one in (here.folder, there)]
    assert names[0] == names[1] != []


@pytest.mark.slow
@pytest.mark.process
def test_a_cluster_of_this_machine_imports_the_code_of_the_start_and_no_file_of_a_packages_name(
    campaign: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also with a folder of temporary files whose path is too long for the sockets of Ray; nothing stays there."""
    temporary = tmp_path / ("long" * 20)
    temporary.mkdir()
    for name in ("TMPDIR", "RAY_TMPDIR"):
        monkeypatch.setenv(name, str(temporary))
    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    monkeypatch.chdir(tmp_path)
    for name in ("numpy", "random", "json", "autodrive"):
        (tmp_path / f"{name}.py").write_text(f"raise RuntimeError('{name}.py of the user')\n")
    (tmp_path / "gain.py").write_text("THROTTLE = 0.5\n")
    driver = (tmp_path / "driver.py").read_text().replace("throttle=0.5", "throttle=gain.THROTTLE")
    (tmp_path / "driver.py").write_text(f"import gain\nimport numpy\nnumpy.zeros(1)\n{driver}")

    class Editing(CampaignObserver):
        def progress(self, progress: CampaignProgress) -> None:
            (tmp_path / "gain.py").write_text("THROTTLE = 1.0\n")

    one = campaign(parameters={}, samples={}, seeds=12, metrics=["distance"], pass_="")
    on_ray = run_campaign(one, "ray", executor=patient(lambda: RayExecutor(one, workers=1)), observer=Editing())
    (tmp_path / "gain.py").write_text("THROTTLE = 0.5\n")
    here = run_campaign(one, "here", workers=0, uses_cache=False)
    assert on_ray.table.read_bytes() == here.table.read_bytes()
    assert here.summary["counts"] == {"done": 12}
    assert [*temporary.iterdir()] == []


def test_files_travel_with_the_campaign(campaign: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "speed.py").write_text("THROTTLE = 0.4\n")
    driver = (tmp_path / "driver.py").read_text().replace("throttle=0.5", "throttle=speed.THROTTLE")
    (tmp_path / "driver.py").write_text(f"import speed\n{driver}")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "route.csv").write_text("1,2\n")
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "data")
    one = campaign(files=["data/route.csv"], parameters={}, samples={})
    packed = CampaignFiles.pack(one)
    assert sorted(packed.files) == ["data/route.csv", "driver.py", "speed.py"]
    there = packed.unpack(tmp_path / "there")
    monkeypatch.chdir(tmp_path / "there" / packed.directory)
    assert Path("route.csv").read_text() == "1,2\n"
    assert (there.folder / "data" / "route.csv").is_file()
    assert Runner(there).run(there.run(0)) == Runner(one).run(one.run(0))


def test_a_script_travels_with_the_modules_beside_it(campaign: Make, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text("import route\n")
    (tmp_path / "route.py").write_text("")
    packed = CampaignFiles.pack(
        campaign(driver="python script.py {port}", parameters={}, samples={}, metrics=["distance"], pass_="")
    )
    assert sorted(Path(name).name for name in packed.files) == ["route.py", "script.py"]


def test_what_cannot_travel_is_one_line(campaign: Make, tmp_path: Path) -> None:
    one = campaign(driver=f"{tmp_path / 'driver.py'}:Driver")
    with pytest.raises(
        AutodriveError, match=r"driver\.py:Driver' cannot be copied to other machines: give a path relative to"
    ):
        CampaignFiles.pack(one)


def test_a_cluster_that_is_not_there_is_one_line(campaign: Make, tmp_path: Path) -> None:
    file = str(campaign().path)
    port = free_port()
    assert f"no Ray cluster at '127.0.0.1:{port}': Connection refused" in refused(
        "campaign", file, "--ray", f"127.0.0.1:{port}", cwd=tmp_path
    )
    assert "'head' is not an address of a Ray cluster: give HOST:PORT" in refused("campaign", file, "--ray", "head")


def test_ray_that_is_not_installed_is_one_line(campaign: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    file = str(campaign().path)
    for arguments in (["--ray", file], [file, "--ray"], [file, "--ray", "auto"]):  # without an address: auto
        assert "ray is not installed: it is in the extra 'ray'" in refused("campaign", *arguments)
