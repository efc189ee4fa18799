"""The row of a World: its numbers, and the compiled stages of the tick that change them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.compile_ahead import compile_ahead
from autodrive.base.jit import resolved
from autodrive.base.pinned import Pinned
from autodrive.graphics.render.look import needs_lamps
from autodrive.physics.sensors.columns import SensorTables
from autodrive.physics.state import BODY_COLUMNS, State, numbers
from autodrive.physics.tick import place
from autodrive.protocol.messages import Event, Lights, TrafficLightFrame, Weather
from autodrive.world.columns import Worlds, restore_row, rows_of_world
from autodrive.world.compile import CompiledScenario
from autodrive.world.controls import Controls
from autodrive.world.motion import StartMotion, set_linkage, set_motion
from autodrive.world.readings import Readings, readings_of
from autodrive.world.rules import lights, radio, rules, stop_lines
from autodrive.world.rules.daylight import SceneLight
from autodrive.world.rules.traffic.rule import switch_lamps
from autodrive.world.tick import drive_traffic, judge, move, sense, show_lights


class Row:
    """What compiled code knows of a World, and the stages of `tick.py` for it."""

    def __init__(self, compiled: CompiledScenario, controls: Controls, engine: str) -> None:
        """`engine`: see `autodrive.make`."""
        self._compiled, self._controls = compiled, controls
        self.rows = rows_of_world(compiled, controls.throttle, controls.steering, engine)
        """All numbers; what changes them changes the results."""
        self.rules = self.rows.worlds.rules
        self._lights, self._light_names = lights.row_of(self.rules.lights), compiled.map.traffic_lights
        self._pinned = Pinned(self.rows)
        self._time = np.zeros(1)
        self._readings = readings_of(self.rows.worlds, self._time, len(compiled.objects))
        self._has_traffic = bool(compiled.fleet.names)
        for stage in (sense, *[drive_traffic] * self._has_traffic, judge):  # beside `move`, which takes longest
            compile_ahead(stage, self._pinned, 0)
        self._move, self._judge = resolved(move, self._pinned, 0), resolved(judge, self._pinned, 0)
        self._sense = resolved(sense, self._pinned, 0)
        self._drive_traffic = resolved(drive_traffic, self._pinned, 0) if self._has_traffic else drive_traffic
        self._show_lights = resolved(show_lights, self._pinned, 0) if compiled.map.traffic_lights else None
        self.hear()

    # -- between ticks -------------------------------------------------------------------------------------------

    def begin(self, qpos: Floats, seed: int, motions: Mapping[int, StartMotion]) -> None:
        """Set the State and the rules as before the first tick.

        `qpos`: of the State at the start; `motions`: of vehicles that do not start at rest, by their numbers.
        """
        c = self._compiled
        c.engine.forget_warnings()
        c.contacts.clear()
        numbers(c.state)[:] = 0.0
        c.state.qpos[:] = qpos
        fixed = c.model.shapes.n_fixed
        c.state.shape_position[:fixed] = c.model.shapes.position[:fixed]
        c.state.shape_rotation[:fixed] = c.model.shapes.rotation[:fixed]
        self.rows.worlds.tick[0], self.rows.worlds.is_unstable[0] = 0, False
        rules.begin(c, self.rules, rules.FIRST, [seed])
        set_linkage(self.rows.worlds, rules.FIRST)
        for i, motion in motions.items():
            set_motion(self._pinned, self.rows.worlds, rules.FIRST, i, motion)
        place(c.model, c.state, c.views)
        self.hear()

    def take_over(self, before: Row, seed: int) -> None:
        """Continue State and rules of another World with the same vehicles; other objects are at their start."""
        c, b = self._compiled, before._compiled
        for name in (*c.vehicles, *c.objects):
            if name in b.vehicles or name in b.objects:
                _, qpos, dof = c.engine.body(name)
                _, old_qpos, old_dof = b.engine.body(name)
                c.state.qpos[qpos : qpos + 7] = b.state.qpos[old_qpos : old_qpos + 7]
                c.state.qvel[dof : dof + 6] = b.state.qvel[old_dof : old_dof + 6]
        for name, column, old in zip(State._fields, c.state, b.state, strict=True):
            if name not in BODY_COLUMNS and not name.startswith("shape_"):
                column[:] = old
        self.rows.worlds.tick[:] = before.rows.worlds.tick
        rules.take_over(c, self.rules, b, before.rules, seed)
        place(c.model, c.state, c.views)
        self.hear()

    def restore(self, saved: Worlds) -> None:
        """Set all numbers to those of `columns.saved_row`."""
        self._compiled.engine.forget_warnings()
        self._compiled.contacts.clear()
        restore_row(self.rows.worlds, saved)
        self.hear()

    @property
    def readings(self) -> Readings:
        """The numbers of the World as the readings of a batch of one world; the next tick overwrites them."""
        numerator, denominator = self.rows.sensors.substep
        self._time[0] = self.tick * self.rows.substeps * numerator / denominator
        return self._readings

    @property
    def tick(self) -> int:
        """Ticks since the reset."""
        return int(self.rows.worlds.tick[0])

    def note_moved(self, vehicle: int) -> None:
        """A vehicle was placed by hand: it has crossed no stop line."""
        stop_lines.forget(self.rules.stop_lines, vehicle)

    def hear(self) -> None:
        """Make messages of what the vehicles have heard by radio."""
        self.heard = radio.readings(self._compiled, self.rules.radio)

    @property
    def lights(self) -> dict[str, TrafficLightFrame]:
        """What the traffic lights show."""
        return lights.frames(self._light_names, self._lights)

    def show_lights(self) -> None:
        """Let the traffic lights follow a change."""
        if self._show_lights is not None:
            self._show_lights(self._pinned, 0)

    # -- stages of the tick --------------------------------------------------------------------------------------

    def drive_traffic(self, time: float, light: SceneLight, weather: Weather | None) -> None:
        """Let the traffic write what its vehicles obey in a tick that begins at `time` [s], and switch their lamps."""
        if self._has_traffic:
            self._drive_traffic(self._pinned, 0)
            self.switch_lamps(time, light, weather)

    def switch_lamps(self, time: float, light: SceneLight, weather: Weather | None) -> None:
        """Let the traffic switch its lamps; the `weather` is None if it is clear."""
        if self._has_traffic:
            drivers, is_dark = self.rules.traffic, needs_lamps(*light.at(time), weather)
            switch_lamps(self.rows.rules.traffic, drivers, self._controls.vehicles, is_dark=is_dark)

    def move(self) -> bool:
        """Move the bodies by a tick; False if the physics has diverged."""
        is_sound = self._move(self._pinned, 0)
        if not is_sound:
            self.rows.worlds.is_unstable[0] = True
        return is_sound

    def judge(self, time: float) -> tuple[Event, ...]:
        """Let the rules judge the tick that has ended at `time` [s]; the events."""
        if not self._judge(self._pinned, 0):
            return ()
        return tuple(rules.events(self._compiled, self.rules, self.rows.thread.rules, time))

    def sense(self, lamps: Sequence[Lights], sensors: SensorTables | None = None) -> None:
        """Sample the sensors that are due, and let the radio send and deliver.

        `lamps`: of the vehicles, for the radio. `sensors`: in place of those of the World.
        """
        messages = self.rows.thread.rules.radio.messages
        for message, lit in zip(messages, lamps, strict=False):
            message[radio.LAMPS] = radio.lamps_number(lit)
        rows = self._pinned if sensors is None else Pinned(self.rows._replace(sensors=sensors))
        if self._sense(rows, 0):
            self.hear()
        self._compiled.sensors.read()
