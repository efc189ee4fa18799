"""Drawings of a World and of a Client, as a viewer of a real server gets them; bad input; what they do not change."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Client, Command, CommandError
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import encode
from autodrive.protocol.drawing import MAX_PRIMITIVES
from autodrive.protocol.messages import Draw, Drawing, Pause, Step
from autodrive.world.simulation import Simulation
from tests.support.viewer import Viewer
from tests.support.waiting import wait_until

CURVE = np.column_stack((np.linspace(0.0, 1.0, 20), np.sin(np.linspace(0.0, 3.0, 20))))


def test_viewers_get_what_a_client_draws_also_later_and_in_a_pause(sim: Client, server: SimulationServer) -> None:
    early, without = Viewer(server.address), Viewer(server.address, drawings=False)
    sim.pause()
    sim.draw.path(CURVE, name="plan", color="#00ff80", width=0.01)
    sim.draw.points([[1.0, 2.0, 3.0]], size=0.1)
    sim.draw.text("goal", (1.0, 2.0, 0.5))
    sim.draw.lines([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], color=(1, 0, 0, 0.5))
    shown = early.wait_for("plan", "points", "text", "lines")
    later = Viewer(server.address)
    assert later.wait_for("plan", "points", "text", "lines") == shown
    plan = shown["plan"].drawing
    assert plan is not None
    assert np.array(plan.points) == pytest.approx(np.column_stack((CURVE, np.full(20, 0.01))), abs=0)
    assert (plan.color, plan.size, shown["plan"].until) == ((0.0, 1.0, 128 / 255, 1.0), 0.01, math.inf)
    sim.draw.path(CURVE[:2], name="plan")
    sim.draw.clear("text")
    sim.draw.points(np.empty((0, 3)))
    assert early.wait_for("plan", "lines")["plan"].drawing != plan
    sim.draw.clear()
    early.wait_for()
    sim.draw.points(CURVE)
    later.wait_for("points")
    sim.reset()
    later.wait_for()
    wait_until(lambda: (without.receive(), without.frames > 0)[1])
    assert not without.drawings


def test_drawings_of_the_world_disappear_by_simulated_time(server: SimulationServer, simulation: Simulation) -> None:
    viewer = Viewer(server.address)
    simulation.request(Draw({"short": Drawing("points", ((0.0, 0.0, 0.0),), lifetime=0.5)})).result()
    until = viewer.wait_for("short")["short"].until
    assert 0.5 <= until <= simulation.world.time + 0.5
    wait_until(lambda: simulation.world.time > until)
    simulation.request(Draw({"next": Drawing("points", ((0.0, 0.0, 0.0),))})).result()
    viewer.wait_for("next")
    simulation.request(Pause()).result()
    simulation.request(Draw({}, clears=True)).result()  # no Frame follows
    viewer.wait_for()


def test_they_change_neither_state_nor_frames_and_belong_to_no_snapshot() -> None:
    plain, drawn = autodrive.make("mini_map"), autodrive.make("mini_map")
    for tick in range(20):
        drawn.draw.path(CURVE + tick)
        drawn.draw.text(f"tick {tick}", (0, 0), lifetime=0.1)
        assert encode(plain.step({"V1": Command(0.5)})) == encode(drawn.step({"V1": Command(0.5)}))
    assert set(drawn.drawings) == {"path", "text"}
    saved = drawn.save()
    drawn.draw.clear()
    drawn.restore(saved)
    assert drawn.drawings == {}


def test_there_is_a_limit_of_all_primitives() -> None:
    world = autodrive.make()
    for number in range(5):
        world.draw.points(np.zeros((2000, 3)), name=f"cloud {number}", lifetime=1.0)
    with pytest.raises(CommandError, match=rf"10001 points.*{MAX_PRIMITIVES}"):
        world.draw.text("A", (0, 0, 0))
    world.draw.points(np.zeros((1999, 3)), name="cloud 0")
    world.draw.text("A", (0, 0, 0))
    with pytest.raises(CommandError, match="10001 points"):
        world.draw.text("AB", (0, 0, 0))
    with Simulation(world, is_paused=True) as simulation:
        simulation.request(Step(math.ceil(1.0 / world.tick_duration))).result()
    world.draw.points(np.zeros((2000, 3)))  # the clouds have disappeared
    assert set(world.drawings) == {"cloud 0", "text", "points"}


WRONG: list[tuple[Callable[[Any], None], str]] = [
    (lambda draw: draw.path([[0, 0, 0]]), "needs 2 to 2000 points, not 1"),
    (lambda draw: draw.path(np.zeros((2001, 3))), "needs 2 to 2000 points, not 2001"),
    (lambda draw: draw.path([1, 2, 3]), "shape"),
    (lambda draw: draw.path(np.zeros((3, 4))), "shape"),
    (lambda draw: draw.path("abc"), "shape"),
    (lambda draw: draw.path([[0, math.nan], [1, 1]]), "coordinates"),
    (lambda draw: draw.points([[0, 1e5, 0]]), "coordinates"),
    (lambda draw: draw.lines(np.zeros((3, 3))), "two points for each line"),
    (lambda draw: draw.points([[0, 0]], color="red"), "#rrggbb"),
    (lambda draw: draw.points([[0, 0]], color=(0, 0)), "#rrggbb"),
    (lambda draw: draw.points([[0, 0]], color=(0, 0, 2)), "from 0 to 1"),
    (lambda draw: draw.points([[0, 0]], size=0), "size or width"),
    (lambda draw: draw.path([[0, 0], [1, 1]], width="wide"), "size or width"),
    (lambda draw: draw.points([[0, 0]], lifetime=-1), "lifetime"),
    (lambda draw: draw.points([[0, 0]], lifetime=math.inf), "lifetime"),
    (lambda draw: draw.points([[0, 0]], name="n" * 101), "100 characters"),
    (lambda draw: draw.points([[0, 0]], name=5), "100 characters"),
    (lambda draw: draw.text("two\nlines", (0, 0)), "one line"),
    (lambda draw: draw.text("", (0, 0)), "1 to 200 characters"),
    (lambda draw: draw.text("a" * 201, (0, 0)), "1 to 200 characters"),
    (lambda draw: draw.text(7, (0, 0)), "must be a text"),
]


def test_wrong_values_are_refused_by_both_and_nothing_changes(sim: Client) -> None:
    world = autodrive.make()
    for call, text in WRONG:
        for draw in (world.draw, sim.draw):
            with pytest.raises(CommandError, match=text):
                call(draw)
    assert world.drawings == {}
    for values in ({"points": []}, {"color": (0, 0, 0, 5)}, {"kind": "cube"}, {"size": -1.0}):
        with pytest.raises(CommandError):
            sim.ask(Draw({"raw": Drawing(**{"kind": "points", "points": ((0, 0, 0),)} | values)}))  # type: ignore[arg-type]
