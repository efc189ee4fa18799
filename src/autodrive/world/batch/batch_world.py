"""BatchWorld: n worlds of one scenario, which one compiled call steps, on several threads."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from autodrive.base.arrays import Floats, Integers
from autodrive.base.child_process import cpu_count
from autodrive.base.errors import CommandError
from autodrive.base.exact_fraction import exact_fraction
from autodrive.base.jit import resolved
from autodrive.base.pinned import Pinned
from autodrive.base.suggest import suggest, with_suggestions
from autodrive.graphics.render.render_state import RenderState
from autodrive.physics.model import Table
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.weather import set_lidar_weather
from autodrive.physics.sensors.tables import set_noise, start_noise
from autodrive.physics.weather import ChangingWeather
from autodrive.protocol.commands import MAX_DISTANCE, check_commands, check_flag, check_seed, check_weather
from autodrive.protocol.messages import Command, Headlights, Weather
from autodrive.scenario import DEFAULT, NEUTRAL, ScenarioSpec
from autodrive.scenario import FACTOR_LIMITS as LIMITS
from autodrive.scenario.vehicles.parameters import set_conditions, set_factors, vehicle_table, wheel_table
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.columns import Rows, rows_of_batch
from autodrive.world.compile import grip_factors, placed_vehicle
from autodrive.world.factory import compile_scenario
from autodrive.world.motion import checked_motions, checked_rows, set_linkage, set_motion
from autodrive.world.one_thread import OneThread, by_one_thread
from autodrive.world.pictures import pictures_of
from autodrive.world.poses import overlapping
from autodrive.world.readings import Readings, readings_of
from autodrive.world.rules import rules
from autodrive.world.tick import begin_worlds, step_worlds

BLOCK = 16
"""Worlds that a thread takes at a time, at least."""

BLOCKS = 8
"""Blocks of worlds for each thread, at most: worlds in contact take longer than others."""


class BatchWorld(OneThread):
    """n worlds of one scenario. World k has the bits of a single `World` with the same seed and commands.

    All sensors have readings, but the cameras. The result does not depend on the number of threads.
    """

    @with_suggestions
    def __init__(
        self,
        scenario: str | Path | ScenarioSpec = DEFAULT,
        n: int = 1,
        *,
        seed: int = 0,
        threads: int | None = None,
        engine: Literal["auto", "always"] = "auto",
    ) -> None:
        """World k starts with the seed `seed` + k. `threads`: at most; None: as many as there are processors.

        `scenario` and `engine`: see `autodrive.make`. Raises `SpecError`, and `CommandError` for other arguments.
        """
        super().__init__()
        check_seed(seed)
        for name, value in (("n", n), ("threads", threads)):
            if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
                raise CommandError(f"{name} must be a whole number from 1 on, not {value!r}")
        check_seed(int(seed) + n - 1)
        if engine not in ("auto", "always"):
            raise CommandError(f"engine must be 'auto' or 'always', not {engine!r}")
        self.compiled = c = compile_scenario(scenario)
        spec = c.specs.scenario
        if any(placement.own_sensors for placement in spec.vehicles.values()):
            raise CommandError(
                "a BatchWorld has no sensors of the user: remove 'own_sensors' from the scenario, or make single Worlds"
            )
        self.n = n
        self.spec = spec
        """The scenario from which `reset` starts."""
        self.map = c.map
        self.vehicle_names = list(c.vehicles)
        self.commanded_names = [name for name in c.vehicles if name not in spec.traffic.names]
        """The first vehicles, which obey commands; the traffic behind them drives itself."""
        self.object_names = list(c.objects)
        self.tick_duration = spec.tick
        self._on_ground = {name: (c.engine.body(name)[1], standing) for name, standing in c.standing.items()}
        """Index of the pose of each body in `State.qpos`, and its pose on the ground."""
        self._tick = exact_fraction(spec.tick)
        count = min(threads or cpu_count(), math.ceil(n / BLOCK))
        self._block = max(BLOCK, n // (BLOCKS * count))
        self._engines = [c.engine, *(c.engine.copy() for _ in range(count - 1))]  # they own the memory of the views
        rows = rows_of_batch(c, n, self._engines, engine)
        self._threads = [Pinned(thread_rows) for thread_rows in rows]
        self.worlds = rows[0].worlds
        """The States of all worlds; what changes them changes the results."""
        self._time = np.zeros(n)
        self.light_names = c.map.traffic_lights
        """Traffic lights follow their programs."""
        self.readings = readings_of(self.worlds, self._time, len(self.object_names))
        """States and sensor readings of all worlds at the present instant."""
        self._seeds = [int(seed) + k for k in range(n)]
        self._factors = {name: np.full((n, len(c.vehicles)), value) for name, value in NEUTRAL.items()}
        """Factors and trim of each vehicle in the present episode of each world, by name, shape (n, v)."""
        self.weathers = [ChangingWeather().at(0.0)] * n
        """Weather of the present episode of each world, with wetness and snow cover."""
        self._factors["noise"][:] = np.nan  # no noise is set yet
        self._has_own_vehicles = np.zeros(n, np.bool_)
        self._is_stepped = np.ones(n, np.bool_)
        self._specs = {
            name: {sensor: configured.spec for sensor, configured in sensors.items()}
            for name, sensors in c.configured.items()
        }
        self._pool, self._pool_process = None, 0
        self._step = resolved(step_worlds, self._threads[0], self._is_stepped, 0, 0, 1)
        self._begin = resolved(begin_worlds, self._threads[0], rules.FIRST)
        self.reset()

    def __repr__(self) -> str:
        vehicles = ", ".join(self.vehicle_names)
        return f"<BatchWorld of {self.n} worlds of map '{self.spec.map_name}': vehicles {vehicles}>"

    @by_one_thread
    def step(self, commands: ArrayLike, ticks: int = 1, worlds: ArrayLike | None = None) -> Readings:
        """Run so many ticks with these commands: throttle and steering (left positive), each in [-1, 1].

        `commands` has the shape (n, v, 2), without the traffic; greater values are limited. `worlds`: those that move,
        as in `reset`; the others stay as they are, and their commands mean nothing. Raises `CommandError` for another
        shape, or a value that is not finite; nothing has moved then.
        """
        self._check_open()
        values = self._checked_commands(commands)
        self._is_stepped[:] = False
        self._is_stepped[self._checked_worlds(worlds)] = True
        if isinstance(ticks, bool) or not isinstance(ticks, int) or ticks < 1:
            raise CommandError(f"ticks must be a whole number from 1 on, not {ticks!r}")
        np.clip(values[..., 0], -1.0, 1.0, out=self.worlds.throttle[:, : values.shape[1]])
        np.clip(values[..., 1], -1.0, 1.0, out=self.worlds.steering[:, : values.shape[1]])
        if len(self._threads) == 1:
            self._step(self._threads[0], self._is_stepped, 0, self.n, ticks)
        else:
            blocks, pool = itertools.count(0, self._block), self._started_pool()
            others = [pool.submit(self._run, thread, blocks, ticks) for thread in self._threads[1:]]
            self._run(self._threads[0], blocks, ticks)
            for other in others:
                other.result()
        return self._show()

    @by_one_thread
    def reset(
        self,
        worlds: ArrayLike | None = None,
        seeds: ArrayLike | None = None,
        *,
        poses: Mapping[str, ArrayLike] | None = None,
        motions: Mapping[str, ArrayLike] | None = None,
        past_commands: Mapping[str, ArrayLike] | None = None,
        vehicles: Mapping[str, Sequence[VehicleSpec]] | None = None,
        mass: ArrayLike = 1.0,
        grip: ArrayLike = 1.0,
        noise: ArrayLike = 1.0,
        drive: ArrayLike = 1.0,
        trim: ArrayLike = 0.0,
        weather: Weather | Sequence[Weather] | None = None,
    ) -> Readings:
        """Return some worlds to the start, all at once; nothing of their last episode remains.

        `worlds`: a mask of shape (n,), or m numbers of worlds; None: all. `seeds`: new ones, shape (m,); a seed stays
        until the next one. `poses`: x, y [m] and yaw [rad] of vehicles or objects on the ground, by name, shape (m, 3)
        or (3,); the others are where the scenario places them, the traffic is where the seed does. `mass`, `grip`,
        `noise`, `drive`: the factors of `VehiclePlacement` in addition to those of the scenario, one number or shape
        (m,) or (m, v); `trim`: as its `steering_trim` [rad], which it adds to.

        `motions`: vehicles start in motion, with rolling wheels: forward and left speed [m/s], yaw rate [rad/s], and
        the throttle and the steering that they have obeyed, by name, shape (m, 5) or (5,); the others start at rest.
        `past_commands`: throttle and steering in the ticks before the start, oldest first, by name, shape (m, t, 2) or
        (t, 2); actuators and dead times follow them, from those of `motions` on.
        `vehicles`: other parameters of dynamics and actuators until the next reset, by name, a Spec for each of the m
        worlds; colliders, sensors and the longest dead times remain those of the scenario.
        `weather`: until the next reset, one for all or one for each of the m worlds; None: that of the scenario.
        Wetness and snow cover are steady.

        Raises `CommandError` for wrong values, and for poses that let two bodies overlap; nothing has changed then.
        """
        self._check_open()
        chosen = self._checked_worlds(worlds)
        new_seeds = self._checked_seeds(seeds, chosen)
        unchecked = {"mass": mass, "grip": grip, "noise": noise, "drive": drive, "trim": trim}
        factors = {name: self._checked_factor(name, factor, chosen) for name, factor in unchecked.items()}
        qpos = self._checked_starts(poses or {}, chosen, new_seeds)
        starts = checked_motions(motions, past_commands, len(chosen))
        moving = {self._vehicle(name): start for name, start in starts.items()}
        own = self._checked_vehicles(vehicles or {}, chosen)
        weathers = self._checked_weathers(self.spec.weather.message if weather is None else weather, chosen)
        w = self.worlds
        for column in w.state:
            column[chosen] = 0.0
        w.state.qpos[chosen] = qpos
        for column in (w.tick, w.is_unstable, w.throttle, w.steering):
            column[chosen] = 0
        rules.begin(self.compiled, w.rules, chosen, new_seeds)
        tables: dict[tuple[object, ...], tuple[Table, Table]] = {}
        for row, k in enumerate(chosen.tolist()):
            self._seeds[k] = new_seeds[row]
            factors_of_world = {name: values[row] for name, values in factors.items()}
            self._set_parameters(k, factors_of_world, own[row], weathers[row], tables)
        set_linkage(w, chosen)
        for i, start in moving.items() if len(chosen) else ():
            set_motion(self._threads[0], w, chosen, i, start)
        self._begin(self._threads[0], chosen)
        return self._show()

    def pictures(self, *, is_day: bool | None = None, headlights: Headlights = Headlights.OFF) -> RenderState:
        """What cameras show of all worlds now, for `BatchCamera.render`: bodies, lamps, lights, hour and weather.

        `is_day`: None is the light of the scenario; `headlights`: of the vehicles that obey commands. The traffic
        switches its own lamps. Raises `CommandError` for wrong values.
        """
        if is_day is not None:
            check_flag(is_day, "is_day")
        check_commands(dict.fromkeys(self.commanded_names, Command(headlights=headlights)))
        rows = self.worlds, self.readings, self.weathers
        return pictures_of(self.compiled, *rows, is_day=is_day, headlights=headlights)

    def close(self) -> None:
        """End the threads; no step can follow."""
        self._is_closed = True
        if self._pool is not None and self._pool_process == os.getpid():
            self._pool.shutdown()

    # -- parts of a step -----------------------------------------------------------------------------------------

    def _started_pool(self) -> ThreadPoolExecutor:
        """The threads of this process: a forked one does not have those of the other."""
        if self._pool is None or self._pool_process != os.getpid():
            self._pool, self._pool_process = ThreadPoolExecutor(len(self._threads) - 1, "batch"), os.getpid()
        return self._pool

    def _run(self, thread: Pinned[Rows], blocks: itertools.count[int], ticks: int) -> None:
        """Take blocks of worlds until none is left."""
        for first in iter(blocks.__next__, None):
            if first >= self.n:
                return
            self._step(thread, self._is_stepped, first, min(first + self._block, self.n), ticks)

    def _show(self) -> Readings:
        numerator, denominator = self._tick.numerator, self._tick.denominator
        np.divide(self.worlds.tick * numerator, denominator, out=self._time)
        return self.readings

    def _set_parameters(
        self,
        k: int,
        factors: Mapping[str, Floats],
        own: Mapping[str, VehicleSpec],
        weather: Weather,
        tables: dict[tuple[object, ...], tuple[Table, Table]],
    ) -> None:
        """Set the tables and the noise of world k. `tables`: those of Specs that other worlds have, too."""
        w, noises = self.worlds, self._factors["noise"][k]
        of_tables = {name: values.tolist() for name, values in factors.items() if name != "noise"}
        is_other = any(self._factors[name][k].tolist() != values for name, values in of_tables.items())
        if is_other or own or self._has_own_vehicles[k] or weather != self.weathers[k]:
            self.weathers[k] = weather
            for name, values in of_tables.items():
                self._factors[name][k] = values
            self._has_own_vehicles[k] = bool(own)
            key = (*map(id, own.values()), *(tuple(values) for values in of_tables.values()), weather)
            if key not in tables:
                tables[key] = self._tables(of_tables, own, weather)
            w.vehicles[k], w.wheels[k] = tables[key]
        for i, (name, specs_of) in enumerate(self._specs.items()):
            if (noise := float(factors["noise"][i])) != noises[i]:
                noises[i] = noise
                set_noise(w.noise, k, i, specs_of, noise)
            start_noise(w.noise, k, i, name, self._seeds[k])
            if isinstance(lidar := specs_of.get("lidar"), LidarSpec):
                set_lidar_weather(w.noise, k, i, name, weather, lidar, self._seeds[k])

    def _tables(
        self, factors: Mapping[str, Sequence[float]], own: Mapping[str, VehicleSpec], weather: Weather
    ) -> tuple[Table, Table]:
        """Tables of vehicles and wheels of a world."""
        c, placed = self.compiled, self.compiled.spec.vehicles  # with the traffic
        of_vehicles = zip(c.vehicles.items(), *(factors[name] for name in ("mass", "drive", "trim")), strict=True)
        specs = {
            name: (placed_vehicle(own[name], placed[name]) if name in own else spec).with_factors(*of_vehicle)
            for (name, spec), *of_vehicle in of_vehicles
        }
        grips = np.multiply(grip_factors(c.spec, specs), factors["grip"]).tolist()
        if own:
            vehicles = vehicle_table(specs, c.engine, c.engine.geoms(), c.spec.substep)
            return vehicles, wheel_table([*specs.values()], grips, c.spec.substep, c.map.ground, weather)
        vehicles, wheels = c.model.vehicles.copy(), c.model.wheels.copy()
        for i, (spec, factor) in enumerate(zip(specs.values(), grips, strict=True)):
            set_factors(vehicles[i], spec)
            set_conditions(wheels[4 * i : 4 * i + 4], spec, factor, c.spec.substep, c.map.ground, weather)
        return vehicles, wheels

    # -- checks of arguments -------------------------------------------------------------------------------------

    def _checked_commands(self, commands: ArrayLike) -> Floats:
        shape = self.n, len(self.commanded_names), 2
        try:
            values = np.asarray(commands, dtype=np.float64)
        except (TypeError, ValueError):
            raise CommandError(f"commands must be numbers of the shape {shape}") from None
        if values.shape != shape:
            raise CommandError(f"commands must have the shape (worlds, vehicles, 2) = {shape}, not {values.shape}")
        if not np.isfinite(values).all():
            k, i, part = np.argwhere(~np.isfinite(values))[0].tolist()
            raise CommandError(
                f"the {('throttle', 'steering')[part]} of vehicle '{self.vehicle_names[i]}' of world {k} must be a "
                f"finite number, not {values[k, i, part]}"
            )
        return values

    def _checked_worlds(self, worlds: ArrayLike | None) -> Integers:
        """Numbers of the chosen worlds."""
        if worlds is None:
            return np.arange(self.n)
        selection = np.asarray(worlds)
        if selection.dtype == np.bool_ and selection.shape == (self.n,):
            return np.flatnonzero(selection)
        if selection.size == 0:
            return np.zeros(0, np.int64)
        is_integer = np.issubdtype(selection.dtype, np.integer) and selection.ndim == 1
        has_twice = is_integer and len({*selection.tolist()}) < len(selection)
        if not is_integer or has_twice or selection.min() < 0 or selection.max() >= self.n:
            raise CommandError(
                f"worlds must be a mask of the shape ({self.n},), or different numbers from 0 to {self.n - 1}"
            )
        return selection.astype(np.int64)

    def _checked_seeds(self, seeds: ArrayLike | None, chosen: Integers) -> list[int]:
        if seeds is None:
            return [self._seeds[k] for k in chosen.tolist()]
        try:
            values = np.asarray(seeds).ravel().tolist() if np.ndim(seeds) <= 1 else []
        except ValueError:  # nested
            values = []
        if len(values) != len(chosen):
            raise CommandError(f"there must be a seed for each of the {len(chosen)} worlds, shape ({len(chosen)},)")
        for new_seed in values:
            check_seed(new_seed)
        return [int(new_seed) for new_seed in values]

    def _checked_factor(self, name: str, factor: ArrayLike, chosen: Integers) -> Floats:
        """A factor of each vehicle in each of the m chosen worlds, shape (m, v). Raises `CommandError`."""
        m, v = len(chosen), len(self.vehicle_names)
        limits = LIMITS[name]
        try:
            factors = np.asarray(factor, dtype=np.float64)
            values = np.empty((m, v))
            values[:] = factors[:, None] if factors.ndim == 1 else factors
        except (TypeError, ValueError):
            raise CommandError(f"{name} must be one number, or have the shape ({m},) or ({m}, {v})") from None
        if not ((values >= limits[0]) & (values <= limits[1])).all():
            kind = "an angle [rad]" if name == "trim" else "a factor"
            raise CommandError(f"{name} is {kind} from {limits[0]:g} to {limits[1]:g}")
        return values

    def _vehicle(self, name: str) -> int:
        """Number of a vehicle."""
        if name not in self.vehicle_names:
            raise CommandError(f"vehicle '{name}' is not in these worlds. {suggest(str(name), self.vehicle_names)}")
        return self.vehicle_names.index(name)

    def _checked_vehicles(
        self, vehicles: Mapping[str, Sequence[VehicleSpec]], chosen: Integers
    ) -> list[dict[str, VehicleSpec]]:
        """The Specs that differ from those of the scenario, of each chosen world."""
        longest = self.worlds.state.throttle_queue.shape[-1] - 1
        for name, specs in vehicles.items():
            self._vehicle(name)
            if len(specs) != len(chosen):
                raise CommandError(f"there must be a Spec of '{name}' for each of the {len(chosen)} worlds")
            surface = self.compiled.spec.vehicles[name].surface
            if any(surface not in (None, *spec.wheels.surfaces) for spec in specs):
                raise CommandError(f"'{name}' is on the floor '{surface}', which 'wheels.surfaces' of a Spec lacks")
            for part in ("steering", "drivetrain"):
                if any(round(getattr(spec, part).dead_time / self.spec.substep) > longest for spec in specs):
                    raise CommandError(
                        f"the longest dead time of the vehicles of the scenario is {longest * self.spec.substep:g} s; "
                        f"{part}.dead_time of '{name}' is longer"
                    )
        return [{name: specs[row] for name, specs in vehicles.items()} for row in range(len(chosen))]

    def _checked_weathers(self, weather: Weather | Sequence[Weather], chosen: Integers) -> list[Weather]:
        """The weather of each chosen world, with wetness and snow cover."""
        weathers = [weather] * len(chosen) if isinstance(weather, Weather) else list(weather)
        if len(weathers) != len(chosen):
            raise CommandError(f"there must be a Weather for each of the {len(chosen)} worlds, not {len(weathers)}")
        for world_weather in weathers:
            check_weather(world_weather)
        return [ChangingWeather.settled(world_weather).at(0.0) for world_weather in weathers]

    def _checked_starts(self, poses: Mapping[str, ArrayLike], chosen: Integers, seeds: Sequence[int]) -> Floats:
        """`State.qpos` of the chosen worlds at the start, shape (m, 7 n_body)."""
        c = self.compiled
        qpos = np.tile(c.engine.start, (len(chosen), 1))
        for name, pose in poses.items():
            if name not in self._on_ground:
                raise CommandError(f"'{name}' is not in these worlds. {suggest(str(name), list(self._on_ground))}")
            values = checked_rows(f"the poses of '{name}'", pose, (len(chosen), 3), "x, y, yaw")
            if not (np.abs(values) <= MAX_DISTANCE).all():
                raise CommandError(f"the poses of '{name}' must be numbers from {-MAX_DISTANCE:g} to {MAX_DISTANCE:g}")
            for row, pose_of_row in zip(qpos, values.tolist(), strict=True):
                self._place(row, name, *pose_of_row)
        names = self.compiled.fleet.names
        others = [start for name, (start, _) in self._on_ground.items() if name not in names]
        for row, seed in zip(qpos, seeds, strict=True) if names else ():
            starts = self.compiled.fleet.start_poses(
                seed, [(x, y) for x, y in (row[at : at + 2].tolist() for at in others)]
            )
            for name, start in starts.items():
                if name not in poses:
                    self._place(row, name, *start)
        for k, row in zip(chosen.tolist(), qpos, strict=True) if poses or names else ():
            for first, second in overlapping(c, row):
                raise CommandError(f"world {k} cannot start: '{first}' and '{second}' would overlap")
        return qpos

    def _place(self, qpos: Floats, name: str, x: float, y: float, yaw: float) -> None:
        """Write the pose of a vehicle or an object on the ground into a row of `State.qpos`."""
        start, standing = self._on_ground[name]
        qpos[start : start + 7] = standing(x, y, yaw)
