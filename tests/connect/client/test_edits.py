"""Edits through the client: what another client sees, the shared history, and the text of the scenario."""

from __future__ import annotations

from pathlib import Path

import pytest

import autodrive
from autodrive import Client, CommandError
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import MapModule, MapPart
from autodrive.scenario.maps.map import load_map
from tests.support.waiting import LIMIT, wait_until


def test_another_client_sees_an_edit_and_can_undo_it(server: SimulationServer, sim: Client) -> None:
    with Client(server.address, name="viewer", timeout=LIMIT) as viewer:
        before = viewer.frame
        frame = sim.add_box("crate", 1.0, 0.9, 0.5, mass=0.3)
        assert frame.objects["crate"].pose.position == pytest.approx((1.0, 0.9, 0.05), abs=1e-3)
        wait_until(lambda: "crate" in viewer.frame.objects)
        assert viewer.frame.time >= before.time
        sim.place("V1", 0.3, 0.1)
        wait_until(lambda: viewer.frame.vehicles["V1"].pose.position[0] == pytest.approx(0.3, abs=1e-3))
        wait_until(lambda: viewer.status.undo == "place V1")
        assert viewer.undo().vehicles["V1"].pose.position[0] == pytest.approx(0.0, abs=1e-3)
        wait_until(lambda: (sim.status.undo, sim.status.redo) == ("add crate", "place V1"))
        assert "crate" not in viewer.undo().objects
        assert "crate" in sim.redo().objects
        assert "crate" not in sim.remove_box("crate").objects


def test_a_sensor_of_a_vehicle_is_set(sim: Client) -> None:
    frame = sim.set_sensor("V1", "lidar", rate=20.0, noise="strong")
    assert frame.tick > 0
    wait_until(lambda: (scan := sim.frame.vehicles["V1"].lidar) is not None and scan.scan_rate == 20.0)
    sim.set_sensor("V1", "lidar", is_on=False)
    wait_until(lambda: sim.frame.vehicles["V1"].lidar is None)
    with pytest.raises(CommandError, match="Did you mean 'lidar'"):
        sim.set_sensor("V1", "lidr")


def test_two_clients_build_a_map_together(server: SimulationServer, sim: Client, tmp_path: Path) -> None:
    with Client(server.address, name="other", timeout=LIMIT) as other:
        sim.edit_map({"a": MapModule("straight_road", 3.0, 0.0)})

        def parts(client: Client) -> dict[str, MapPart]:
            assert client.scene.map_scene is not None
            return client.scene.map_scene.parts

        wait_until(lambda: "a" in parts(other))
        seen = {"a": parts(other)["a"]}
        assert parts(sim) == parts(other)
        other.edit_map({"b": MapModule("straight_road", 3.6, 0.0)}, seen={"b": None})
        wait_until(lambda: "b" in parts(sim))
        sim.edit_map({"a": MapModule("straight_road", 3.0, 0.0, open=True)}, seen=seen)
        with pytest.raises(CommandError, match="'a' was changed by another client in the meantime"):
            other.edit_map({"a": None}, seen=seen)
        wait_until(lambda: other.status.undo == "change a")
        assert other.map_text() == sim.map_text()
        other.undo()
        wait_until(lambda: parts(sim)["a"] == seen["a"])
        sim.use_map("mini_map")
        wait_until(lambda: "lawn_1" in parts(other))
        sim.undo()
    (tmp_path / "map.yaml").write_text(sim.map_text("Ours"))
    assert load_map(tmp_path / "map.yaml").title == "Ours"


def test_the_text_of_the_scenario_is_that_of_the_edited_world(sim: Client, tmp_path: Path) -> None:
    sim.place("V1", 0.3, 0.1, 0.2)
    sim.add_box("crate", 1.0, 0.9)
    sim.set_scene_light(False)
    file = tmp_path / "mine.yaml"
    file.write_text(sim.scenario_text(), encoding="utf-8")
    frame = autodrive.make(file).frame
    assert frame.vehicles["V1"].pose.position == pytest.approx((0.3, 0.1, 0.0325))
    assert "crate" in frame.objects
    assert not frame.scene_light
    assert sim.scenario_text() == file.read_text(encoding="utf-8")
