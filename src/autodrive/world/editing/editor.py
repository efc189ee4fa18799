"""Edits a running World, and remembers its edits for undo and redo."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError
from autodrive.protocol.messages import AddBox, CloseLoop, Edit, EditMap, InsertModule, Place, RemoveBox
from autodrive.scenario.descriptions import Descriptions, Specs
from autodrive.scenario.tracks.track import TrackSpec
from autodrive.world import World
from autodrive.world.compile import CompiledScenario
from autodrive.world.editing.closing import closing_edit
from autodrive.world.editing.edits import edited, name_of
from autodrive.world.editing.inserting import inserting_edit
from autodrive.world.editing.map_edits import MapEdit, edited_map, name_of_edit, own_map, parts_of
from autodrive.world.editing.track_edits import vehicles_beside
from autodrive.world.factory import compile_scenario
from autodrive.world.poses import overlapping

MAX_EDITS = 200
"""Edits that can be undone; older ones are forgotten."""

Poses: TypeAlias = Mapping[str, Floats | None]
"""Where vehicles and objects are placed, by name; None: where the scenario starts with them."""


@dataclass(frozen=True)
class Change:
    """An edit that was made."""

    name: str
    before: Specs
    after: Specs
    poses_before: Poses
    poses_after: Poses


class Editor:
    """One history of edits for all clients. `make` makes the World of a scenario; None: edits can only change poses.

    A move, which changes poses only, happens in the World. Every other edit makes a new World, which continues from the
    present one: time continues, and everything that was not edited keeps its pose, speed and readings.
    """

    def __init__(self, make: Callable[[Descriptions], World] | None) -> None:
        self._make = make
        self._undo: deque[Change] = deque(maxlen=MAX_EDITS)
        self._redo: list[Change] = []

    @property
    def undo_name(self) -> str:
        """The edit that `undo` reverts; empty if there is none."""
        return self._undo[-1].name if self._undo else ""

    @property
    def redo_name(self) -> str:
        """The edit that `redo` makes again; empty if there is none."""
        return self._redo[-1].name if self._redo else ""

    def edit(self, world: World, edit: Edit) -> World:
        """Make an edit; the World after it, which may be a new one. Raises `AutodriveError`; then nothing changes."""
        specs = replace(world.specs, scenario=world.spec)
        before: dict[str, Floats | None] = {}
        moved: Poses = {}
        title = ""
        if isinstance(edit, CloseLoop):
            edit, title = closing_edit(world, edit), "close the loop" if edit.part else "close all open ends"
        if isinstance(edit, InsertModule):
            title = f"insert {edit.module}"
            edit = inserting_edit(world, edit)
        if isinstance(edit, MapEdit):
            after, name = edited_map(specs, edit), title or name_of_edit(edit, specs)
            changed = edit.parts if isinstance(edit, EditMap) else _replaced(world, after)
            before = {part: world.pose(part) for part in changed if part in world.boxes or part in world.vehicle_names}
            moved = dict.fromkeys(changed)
        else:
            after, name = replace(specs, scenario=edited(world.spec, world.boxes, edit)), name_of(edit)
            if isinstance(edit, Place | RemoveBox):
                before = {edit.name: world.pose(edit.name)}
            if isinstance(edit, Place | AddBox):
                moved = {edit.name: None}
        result = self._changed(world, after, moved)
        self._undo.append(Change(name, specs, after, before, moved))
        self._redo.clear()
        return result

    def undo(self, world: World) -> World:
        """Revert the latest edit."""
        if not self._undo:
            raise CommandError("there is no edit to undo")
        change = self._undo[-1]
        result = self._changed(world, change.before, change.poses_before)
        self._redo.append(self._undo.pop())
        return result

    def redo(self, world: World) -> World:
        """Make the edit again that was reverted last."""
        if not self._redo:
            raise CommandError("there is no edit to redo")
        change = self._redo[-1]
        result = self._changed(world, change.after, change.poses_after)
        self._undo.append(self._redo.pop())
        return result

    def on_reset(self) -> None:
        """Note a reset: undoing an earlier edit then moves its vehicle or object to its start."""
        for i, change in enumerate(self._undo):
            self._undo[i] = replace(change, poses_before=dict.fromkeys(change.poses_before))

    def forget(self) -> None:
        """Forget all edits: another scenario was loaded."""
        self._undo.clear()
        self._redo.clear()

    def _changed(self, world: World, specs: Specs, poses: Poses) -> World:
        """The World of other Specs; `poses` are those of the vehicles and boxes that are placed, if there are such."""
        descriptions = Descriptions(specs)
        compiled = compile_scenario(descriptions)
        targets = {
            name: _start(compiled, name) if pose is None else pose
            for name, pose in poses.items()
            if name in compiled.objects or name in compiled.vehicles
        }
        if _bodies(compiled) == _bodies(world):
            world.set_poses(targets)
            world.start_from(compiled)
            return world
        if self._make is None:
            raise CommandError("this Simulation was made for one World: only poses of vehicles and boxes can be edited")
        made = self._make(descriptions)
        try:
            if made.vehicle_names == world.vehicle_names:  # without the traffic, everything starts anew
                made.continue_from(world)
            made.set_poses(targets)
            _check_is_free(made, world)
        except BaseException:
            made.close()
            raise
        return made


def _replaced(world: World, after: Specs) -> list[str]:
    """What goes to its start if the map is replaced: the boxes, and the vehicles beside a track."""
    if isinstance(after.map.spec_or_none, TrackSpec):
        return [*world.boxes, *vehicles_beside(world, after.map.spec_or_none)]
    return [*parts_of(own_map(after)), *world.boxes]


def _start(compiled: CompiledScenario, name: str) -> Floats:
    qpos = compiled.engine.body(name)[1]
    return compiled.engine.start[qpos : qpos + 7]


def _check_is_free(made: World, before: World) -> None:
    """Raises `CommandError` if a vehicle or a box is in a wall, block or sign that was not there before."""
    there = set(before.map.statics)
    new = {static.name for static in made.map.statics if static not in there}
    if not new:
        return
    for pair in overlapping(made.compiled):
        if fixed := new & {*pair}:
            name = next(iter({*pair} - fixed), pair[0])
            raise CommandError(f"'{name}' and '{(other := fixed.pop())}' would overlap: move '{name}' or '{other}'")


def _bodies(world: CompiledScenario | World) -> object:
    """What makes a World but poses."""
    boxes = world.boxes.values() if isinstance(world, World) else world.boxes
    vehicles = {
        name: placement.model_copy(update={"x": 0.0, "y": 0.0, "yaw_deg": 0.0})
        for name, placement in world.spec.vehicles.items()
    }
    return id(world.specs.map), vehicles, [(box.name, box.size, box.mass) for box in boxes]
