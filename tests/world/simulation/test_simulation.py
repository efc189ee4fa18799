"""The simulation of a real world, paced by a clock that the test controls."""

from __future__ import annotations

import itertools
import logging
import math
import threading
import time
from collections.abc import Iterator

import pytest

import autodrive
from autodrive import Command, CommandError, EngineError, Frame, Simulation, SpecError
from autodrive.protocol.messages import (
    AddBox,
    LoadScenario,
    Pause,
    Place,
    Reset,
    Resume,
    SetDrivingMode,
    SetSceneLight,
    SetSpeed,
    Step,
    Teleport,
)
from autodrive.world import World
from tests.support.waiting import LIMIT, wait_until


@pytest.fixture
def world() -> World:
    world = autodrive.make("plane")
    world.set_driving_mode("V1", True)
    return world


@pytest.fixture
def simulation(world: World) -> Iterator[Simulation]:
    """As fast as possible, in a thread of its own."""
    with Simulation(world, speed=None) as running:
        yield running


class ManualClock:
    """Jumps to the end of each wait, so that a run takes no time and depends on no load."""

    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time

    def wait(self, condition: threading.Condition, timeout: float | None) -> None:
        if timeout is None:
            condition.wait(LIMIT)  # until a request arrives
        else:
            self.time += timeout


class Recorder:
    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def publish(self, frame: Frame) -> None:
        self.frames.append(frame)


def speed_after(world: World, *, autonomous: bool, source: str) -> float:
    """Forward speed [m/s] after a second of full throttle from that source."""
    simulation = Simulation(world, speed=None)
    simulation.request(SetDrivingMode("V1", autonomous))

    class Driver:
        def publish(self, frame: Frame) -> None:
            simulation.submit("V1", Command(throttle=1.0), source)  # pyright: ignore[reportArgumentType]

    simulation.add_sink(Driver())
    return simulation.run(1.0).vehicles["V1"].speed


def test_a_run_of_some_seconds_is_that_many_ticks(world: World) -> None:
    simulation = Simulation(world, speed=None)
    frame = simulation.run(0.25)
    assert frame.tick == round(0.25 / world.tick_duration)
    assert simulation.ticks == frame.tick
    assert simulation.simulated_time == pytest.approx(0.25, abs=1e-9)  # rounding of one product
    assert not simulation.is_running


def test_every_tick_reaches_every_sink_once_and_in_order_until_it_is_removed(world: World) -> None:
    simulation, first, second = Simulation(world, speed=None), Recorder(), Recorder()
    simulation.add_sink(first)
    simulation.add_sink(second)
    simulation.run(0.5)
    simulation.remove_sink(first)
    simulation.run(0.1)
    assert [frame.tick for frame in second.frames] == list(range(1, simulation.ticks + 1))
    assert first.frames == second.frames[:50]


def test_a_sink_that_raises_is_logged_and_removed_and_the_others_continue(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    class Faulty:
        calls = 0

        def publish(self, frame: Frame) -> None:
            self.calls += 1
            raise OSError("the disk is full")

    simulation, faulty, healthy = Simulation(world, speed=None), Faulty(), Recorder()
    simulation.add_sink(faulty)
    simulation.add_sink(healthy)
    simulation.run(0.2)
    assert faulty.calls == 1
    assert len(healthy.frames) == simulation.ticks
    assert "Faulty raised" in caplog.text
    assert "the disk is full" in caplog.text


@pytest.mark.parametrize("speed", [1.0, 2.0, None])
def test_simulated_time_passes_at_the_speed_of_the_clock(world: World, speed: float | None) -> None:
    clock = ManualClock()
    simulation = Simulation(world, speed=speed, clock=clock)
    simulation.run(1.5)
    # the first tick is due at once and the last is not waited for
    assert clock.time - 100.0 == (pytest.approx((1.5 - world.tick_duration) / speed) if speed else 0.0)
    assert simulation.running_time == pytest.approx(clock.time - 100.0)
    assert simulation.late_ticks == 0


@pytest.mark.wall_clock
def test_the_wall_clock_is_the_default(world: World) -> None:
    # the real clock is what is tested; a busy machine may be slower but never faster
    begin = time.perf_counter()
    Simulation(world).run(0.1)
    assert time.perf_counter() - begin >= 0.1 - 2 * world.tick_duration


def test_a_world_that_cannot_keep_up_is_logged_at_intervals_and_runs_every_tick(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    clock = ManualClock()

    class Slow:
        def publish(self, frame: Frame) -> None:
            clock.time += 3 * world.tick_duration

    simulation = Simulation(world, clock=clock)
    simulation.add_sink(Slow())
    with caplog.at_level(logging.WARNING, "autodrive"):
        simulation.run(5.0)
    warnings = [record for record in caplog.records if "cannot keep up" in record.message]
    assert len(warnings) == 2  # 15 s of the clock: one at the beginning and one after 10 s
    assert simulation.late_ticks > 0
    assert simulation.ticks == round(5.0 / world.tick_duration)


def test_the_latest_command_wins(world: World) -> None:
    simulation = Simulation(world, speed=None)
    for throttle in (-0.3, 0.7):
        simulation.submit("V1", Command(throttle))
    assert simulation.run(0.1).vehicles["V1"].throttle == 0.7


def test_a_command_is_passed_on_once_so_that_the_world_can_time_it_out(world: World) -> None:
    simulation = Simulation(world, speed=None)
    simulation.submit("V1", Command(throttle=1.0))
    assert simulation.run(0.3).vehicles["V1"].throttle == 1.0
    assert simulation.run(1.0).vehicles["V1"].throttle == 0.0  # the scenario's command_timeout is 0.5 s


@pytest.mark.parametrize(("autonomous", "driver", "other"), [(True, "script", "person"), (False, "person", "script")])
def test_an_autonomous_vehicle_obeys_scripts_only_and_another_one_a_person_only(
    world: World, autonomous: bool, driver: str, other: str
) -> None:
    assert speed_after(world, autonomous=autonomous, source=driver) > 0.1
    world.reset(0)
    assert abs(speed_after(world, autonomous=autonomous, source=other)) < 1e-3  # at rest but for settling


def test_a_command_left_in_the_other_mode_does_not_act_after_a_change_of_mode(world: World) -> None:
    simulation = Simulation(world, speed=None)
    simulation.submit("V1", Command(throttle=1.0), "person")
    simulation.run(0.05)
    simulation.request(SetDrivingMode("V1", is_autonomous=False))
    assert simulation.run(0.05).vehicles["V1"].throttle == 0.0


def test_a_pause_stops_time_and_a_resume_lets_it_run(simulation: Simulation) -> None:
    paused = simulation.request(Pause()).result(LIMIT)
    assert simulation.request(Step(3)).result(LIMIT).tick == paused.tick + 3  # no tick came between
    assert simulation.request(Step(1)).result(LIMIT).tick == paused.tick + 4
    simulation.request(Resume())
    wait_until(lambda: simulation.frame.tick > paused.tick)


def test_a_short_step_may_run_in_the_thread_of_the_caller_during_a_pause(simulation: Simulation) -> None:
    simulation.request(Pause()).result(LIMIT)
    threads: set[str] = set()

    class Sink:
        def publish(self, frame: Frame) -> None:
            threads.add(threading.current_thread().name)

    simulation.add_sink(Sink())
    wait_until(lambda: simulation.request(Step(1), here=True).done())  # as soon as its own thread sleeps
    threads.clear()
    tick = simulation.frame.tick
    done = [simulation.request(Step(2), here=True) for _ in range(10)]
    assert all(one.done() for one in done)
    assert [one.result().tick for one in done] == [tick + 2 * n for n in range(1, 11)]
    assert threads == {threading.current_thread().name}


def test_a_step_here_is_queued_while_the_simulation_runs(simulation: Simulation) -> None:
    pause = simulation.request(Pause())
    step, long = simulation.request(Step(1), here=True), simulation.request(Step(11), here=True)
    first = pause.result(LIMIT).tick
    assert [step.result(LIMIT).tick, long.result(LIMIT).tick] == [first + 1, first + 12]


def test_steps_here_from_many_threads_between_pauses_all_count(simulation: Simulation) -> None:
    simulation.request(Pause()).result(LIMIT)
    before = simulation.frame.tick
    ticks: list[int] = []

    def ask() -> None:
        for n in range(100):
            ticks.append(simulation.request(Step(1), here=True).result(LIMIT).tick)
            if n % 10 == 0:
                simulation.request(SetSceneLight(n % 20 == 0)).result(LIMIT)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    assert len(ticks) == 400
    assert simulation.request(Pause()).result(LIMIT).tick == before + 400


def test_the_commands_of_a_step_apply_in_its_first_tick_in_every_driving_mode(world: World) -> None:
    with Simulation(world, is_paused=True) as simulation:
        simulation.request(SetDrivingMode("V1", is_autonomous=False))
        frame = simulation.request(Step(50, {"V1": Command(0.5)})).result(LIMIT)
    world.reset(0)
    alone = [world.step({"V1": Command(0.5)})] + [world.step() for _ in range(49)]
    assert frame.vehicles["V1"].speed == alone[-1].vehicles["V1"].speed > 0.1


def test_another_scenario_replaces_the_world_and_sinks_stay(world: World) -> None:
    recorder = Recorder()
    with Simulation(world, is_paused=True, load=autodrive.make) as simulation:
        simulation.add_sink(recorder)
        simulation.request(Step(10)).result(LIMIT)
        frame = simulation.request(LoadScenario("two_cars")).result(LIMIT)
        assert (frame.tick, list(frame.vehicles)) == (0, ["V1", "V2"])
        assert recorder.frames[-1] is frame
        simulation.submit("V2", Command(0.5))
        simulation.request(Step(5)).result(LIMIT)
        assert (simulation.ticks, simulation.simulated_time) == (15, pytest.approx(0.15))


def test_a_scenario_that_cannot_be_loaded_leaves_the_world_as_it_is(world: World) -> None:
    with Simulation(world, is_paused=True, load=autodrive.make) as simulation:
        with pytest.raises(SpecError, match="scenario 'nix' is not known"):
            simulation.request(LoadScenario("nix")).result(LIMIT)
        assert simulation.request(Step(3)).result(LIMIT).tick == 3
        assert simulation.world is world


def test_a_world_is_prepared_while_time_goes_on_and_starts_with_its_request() -> None:
    made: list[World] = []
    with Simulation(
        autodrive.make("plane"), speed=None, load=lambda name: (made.append(autodrive.make(name)), made[-1])[1]
    ) as simulation:
        for name in ("two_cars", "mini_map"):
            prepared = simulation.prepare(name)
            assert simulation.frame.vehicles.keys() == {"V1"}
        simulation.request(LoadScenario("mini_map")).result(LIMIT)
        assert simulation.world is prepared is made[1]
        with pytest.raises(SpecError, match="scenario 'nix' is not known"):
            simulation.prepare("nix")
        simulation.request(LoadScenario("two_cars")).result(LIMIT)
        assert simulation.world is made[2], "the first World of this name was replaced before"


@pytest.mark.parametrize("edit", [Place("V1", 1e6, 0.0), AddBox("box", 0.0, 0.0)], ids=["refused", "overlap"])
def test_requests_that_follow_each_other_at_once_leave_a_tick_between(world: World, edit: Place | AddBox) -> None:
    count = itertools.count(1)
    simulation = Simulation(world, speed=None, load=autodrive.make)
    before = simulation.ticks

    def ask(_: object = None) -> None:
        if next(count) < 20:
            simulation.request(edit).add_done_callback(ask)

    ask()
    simulation.run(5 * world.tick_duration)
    assert simulation.ticks == before + 5
    assert next(count) == 7, "the first request, and one for each tick"


def test_a_simulation_of_one_world_loads_no_other(simulation: Simulation) -> None:
    with pytest.raises(CommandError, match="loads no other scenario"):
        simulation.request(LoadScenario("plane"))


def test_time_in_a_pause_is_not_caught_up(world: World) -> None:
    clock = ManualClock()
    with Simulation(world, is_paused=True, clock=clock) as simulation:
        clock.time += 60.0
        simulation.request(Resume()).result(LIMIT)
        wait_until(lambda: simulation.ticks > 20)
        simulation.request(Pause()).result(LIMIT)
        assert simulation.ticks * world.tick_duration == pytest.approx(
            simulation.running_time, abs=1.5 * world.tick_duration
        )
        assert simulation.late_ticks == 0


def test_the_speed_can_be_changed_while_running(world: World) -> None:
    with Simulation(world, speed=1e-3) as simulation:
        simulation.request(SetSpeed(None)).result(LIMIT)
        assert simulation.speed is None
        wait_until(lambda: simulation.simulated_time > 2.0)


def test_requests_are_executed_in_order_before_the_next_tick(world: World) -> None:
    simulation = Simulation(world, speed=None)
    simulation.run(0.2)
    done = [
        simulation.request(request)
        for request in (Reset(7), Teleport("V1", 1.0, -0.5, 0.3), SetSceneLight(False), SetDrivingMode("V1", False))
    ]
    simulation.run(world.tick_duration)
    reset, teleported, dark, manual = (future.result(0) for future in done)
    assert (reset.tick, reset.time) == (0, 0.0)
    assert teleported.vehicles["V1"].pose.position[:2] == pytest.approx([1.0, -0.5], abs=1e-9)
    assert not dark.scene_light
    assert not manual.vehicles["V1"].is_autonomous
    assert simulation.frame.tick == 1


def test_with_pause_on_error_an_error_of_the_physics_pauses_until_a_reset(world: World) -> None:
    with Simulation(world, speed=None, pause_on_error=True) as simulation:
        simulation.request(Pause()).result(LIMIT)
        world.compiled.state.qvel[0] = math.nan
        simulation.request(Resume()).result(LIMIT)
        wait_until(lambda: simulation.error)
        assert "unstable" in simulation.error
        assert simulation.is_paused
        assert simulation.is_running
        with pytest.raises(CommandError, match="request Reset first"):
            simulation.request(Resume())
        simulation.request(Reset()).result(LIMIT)
        assert simulation.error == ""
        simulation.request(Resume()).result(LIMIT)
        then = simulation.ticks
        wait_until(lambda: simulation.ticks > then)


def test_without_pause_on_error_an_error_of_the_physics_ends_the_run(world: World) -> None:
    world.compiled.state.qvel[0] = math.nan
    with pytest.raises(EngineError, match="unstable"):
        Simulation(world, speed=None).run(1.0)


def test_sinks_see_what_a_request_changed_even_while_paused(world: World) -> None:
    sink = Recorder()
    with Simulation(world, is_paused=True) as simulation:
        simulation.add_sink(sink)
        simulation.request(SetSceneLight(False)).result(LIMIT)
        assert [frame.scene_light for frame in sink.frames] == [False]


def test_a_reset_does_not_change_the_time_that_was_run(world: World) -> None:
    simulation = Simulation(world, speed=None)
    simulation.run(0.2)
    simulation.request(Reset())
    simulation.run(0.3)
    assert simulation.simulated_time == pytest.approx(0.5, abs=1e-9)  # rounding of one product
    assert simulation.frame.time == pytest.approx(0.3, abs=1e-9)


def test_a_sink_may_stop_the_simulation(world: World) -> None:
    simulation = Simulation(world, speed=None)

    class StopsAtTen:
        def publish(self, frame: Frame) -> None:
            if frame.tick == 10:
                simulation.stop()

    simulation.add_sink(StopsAtTen())
    assert simulation.run(LIMIT).tick == 10


def test_stop_from_another_thread_ends_a_run(world: World) -> None:
    simulation = Simulation(world, speed=None)

    def stop() -> None:
        wait_until(lambda: simulation.ticks > 0)
        simulation.stop()

    thread = threading.Thread(target=stop)
    thread.start()
    simulation.run()
    thread.join(LIMIT)
    assert not thread.is_alive()
    assert not simulation.is_running


def test_stop_does_not_wait_for_a_slow_pace(world: World) -> None:
    simulation = Simulation(world, speed=1e-5)  # a tick each thousand seconds
    simulation.start()
    wait_until(lambda: simulation.ticks > 0)
    begin = time.perf_counter()
    simulation.stop()
    assert time.perf_counter() - begin < LIMIT


def test_it_can_be_started_again_after_a_stop(world: World) -> None:
    simulation = Simulation(world, speed=None)
    for target in (10, 20):
        simulation.start(10 * world.tick_duration)
        assert simulation.wait(LIMIT)
        assert simulation.ticks == target


def test_a_running_simulation_cannot_be_started_twice(simulation: Simulation) -> None:
    with pytest.raises(RuntimeError, match="is running already"):
        simulation.start()
    with pytest.raises(RuntimeError, match="is running already"):
        simulation.run(1.0)


def test_wait_returns_whether_the_run_has_ended(world: World) -> None:
    with Simulation(world, is_paused=True) as simulation:
        assert not simulation.wait(0.01)
    assert simulation.wait(0.0)


def test_an_error_that_ends_the_thread_is_raised_by_wait(world: World) -> None:
    simulation = Simulation(world, speed=None)
    world.step = lambda *_: (_ for _ in ()).throw(ArithmeticError("the state is not finite"))  # type: ignore[method-assign]
    try:
        simulation.start()
        with pytest.raises(ArithmeticError, match="the state is not finite"):
            simulation.wait(LIMIT)
    finally:
        del world.step
    assert not simulation.is_running


def test_commands_from_many_threads_at_once_are_safe(simulation: Simulation) -> None:
    stop = threading.Event()
    errors: list[Exception] = []

    def hammer(value: float) -> None:
        try:
            for number in itertools.count():
                if stop.is_set():
                    return
                simulation.submit("V1", Command(throttle=value))
                if number % 50 == 0:
                    simulation.request(SetSceneLight(True)).result(LIMIT)
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=hammer, args=(value,)) for value in (0.0, 0.2, 0.4)]
    for thread in threads:
        thread.start()
    before = simulation.ticks
    wait_until(lambda: simulation.ticks > before + 50)
    stop.set()
    for thread in threads:
        thread.join(LIMIT)
    assert not errors
