"""Snapshots of a World that are foreign, damaged or come from another process."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import SnapshotError
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.protocol.messages import Command, Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import Snapshot, World
from tests.support.command_line import python
from tests.support.frames import arrays, digest, digests

SPEC = ScenarioSpec(
    vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)}, boxes={"box": BoxSpec(x=0.36, y=0.0)}
)


def drive(frame: Frame) -> dict[str, Command]:
    return {name: Command(throttle=1.0, steering=0.2) for name in frame.vehicles}


def driven(spec: ScenarioSpec = SPEC, ticks: int = 40) -> World:
    world = autodrive.make(spec)
    digests(world, ticks, drive)
    return world


def changed(spec: ScenarioSpec, **changes: Any) -> ScenarioSpec:
    return spec.model_copy(update=changes)


FOREIGN = {
    "another map": changed(SPEC, map="mini_map", boxes={}),
    "a box less": changed(SPEC, boxes={}),
    "another box": changed(SPEC, boxes={"box": BoxSpec(x=0.36, y=0.0, mass=0.2)}),
    "another name": changed(SPEC, vehicles={"V2": VehiclePlacement()}),
    "another vehicle": changed(SPEC, vehicles={"V1": VehiclePlacement(type="nigel_2023")}),
    "two vehicles": changed(SPEC, vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(y=2.0)}),
    "another tick": changed(SPEC, tick=0.02),
    "another sensor": changed(
        SPEC, vehicles={"V1": VehiclePlacement(sensors={"imu": SensorSettings(noise="realistic")})}
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_snapshot_of_another_scenario_is_refused_and_nothing_has_changed(name: str) -> None:
    world, other = driven(), driven()
    with pytest.raises(SnapshotError, match="another world"):
        world.restore(driven(FOREIGN[name]).save())
    assert digests(world, 30, drive) == digests(other, 30, drive)


def wrong(saved: Snapshot) -> dict[str, Any]:
    """What is no snapshot of this world, or cannot be continued."""
    state = saved.row.state

    def with_positions(positions: Any) -> Snapshot:
        return saved._replace(row=saved.row._replace(state=state._replace(vehicle_position=positions)))

    return {
        "None": None,
        "a tuple": tuple(saved),
        "a Frame": saved.frame,
        "a dictionary": saved._asdict(),
        "no identity": saved._replace(world=""),
        "a short state": with_positions(state.vehicle_position[:, :0]),
        "another type of number": with_positions(state.vehicle_position.astype(np.float32)),
        "NaN in the state": with_positions(state.vehicle_position * np.nan),
        "no state": saved._replace(row=saved.row._replace(state=None)),
        "no row": saved._replace(row=None),
    }


def test_what_is_no_snapshot_is_refused_and_nothing_has_changed() -> None:
    world, other = driven(), driven()
    for saved in wrong(world.save()).values():
        with pytest.raises(SnapshotError):
            world.restore(saved)
    assert digests(world, 30, drive) == digests(other, 30, drive)


def test_a_world_with_cameras_refuses_a_snapshot_without(gl: str) -> None:
    world = autodrive.make("mini_map", cameras=True)
    before = digest(world.frame)
    with pytest.raises(SnapshotError, match="without cameras"):
        world.restore(autodrive.make("mini_map").save())
    assert digest(world.frame) == before
    world.close()


def test_the_seed_and_the_title_of_a_scenario_may_differ() -> None:
    world, other = driven(), autodrive.make(changed(SPEC, title="another", seed=7))
    other.restore(world.save())
    assert digests(world, 30, drive) == digests(other, 30, drive)


@pytest.mark.process
def test_a_snapshot_of_another_process_has_the_same_future(tmp_path: Path) -> None:
    code = (
        "import pickle, sys\nfrom tests.hardening.test_snapshots import driven\n"
        "pickle.dump(driven().save(), open(sys.argv[1], 'wb'))\n"
    )
    file = tmp_path / "snapshot"
    python("-c", code, file, cwd=Path(__file__).parents[2])
    world, other = driven(), autodrive.make(SPEC)
    saved: Snapshot = pickle.loads(file.read_bytes())
    other.restore(saved)
    assert digests(world, 30, drive) == digests(other, 30, drive)


@pytest.mark.parametrize("copied", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy])
def test_frames_that_were_pickled_or_copied_are_equal_and_read_only(copied: Any) -> None:
    world = autodrive.make("mini_map")
    digests(world, 150, drive)
    saved = world.save()
    world.restore(copied(saved))
    for frame in (copied(saved.frame), world.frame, world.step()):
        assert len(arrays(frame)) > 20
        assert not [array for array in arrays(frame) if array.flags.writeable]
    assert digest(copied(saved.frame)) == digest(saved.frame)
