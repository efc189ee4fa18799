"""Each penalty of a head to head on closed-form motion along an oval of two straights and two half circles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from autodrive.protocol.messages import Collision, RacePenalty
from autodrive.scenario.tracks import Track
from autodrive.world.racing import Race, RaceRules, load_rules
from autodrive.world.racing.contacts import ContactJudge, Fault

STRAIGHT, RADIUS, WIDTH = 20.0, 2.5, 1.0
TURN = math.pi * RADIUS
TICK = 0.025

Place = tuple[float, float]
"""Along the centre line, to the left of it [m]."""
Motion = Callable[[float], Place]
"""Place at a time before the contact, from -4 s to 0 s."""


def oval() -> Track:
    """Left turns; a straight from s = 0 to 20 m, a half circle to 27.85 m, and the same again."""
    along = np.arange(0.0, STRAIGHT, 0.1)
    angle = np.linspace(-math.pi / 2, math.pi / 2, 101)[:-1]
    bend = np.column_stack([STRAIGHT + RADIUS * np.cos(angle), RADIUS * np.sin(angle)])
    half = np.vstack([np.column_stack([along, np.full(len(along), -RADIUS)]), bend])
    points = np.vstack([half, np.array([STRAIGHT, 0.0]) - half])
    return Track("oval", np.column_stack([points, np.full((len(points), 2), WIDTH)]))


OVAL = oval()


def judge(first: Motion, second: Motion) -> Fault:
    """The fault of the contact at the end of these motions."""
    contacts = ContactJudge(OVAL, 2, TICK)
    for k in range(-160, 1):
        places = [motion(k * TICK) for motion in (first, second)]
        s = np.array([place[0] % OVAL.length for place in places])
        contacts.note(10.0 + k * TICK, s, np.array([place[1] for place in places]))
    fault = contacts.fault(0, 1)
    mirrored = contacts.fault(1, 0)
    assert (fault.name, set(fault.vehicles)) == (mirrored.name, set(mirrored.vehicles))
    return fault


def at(s: float, lateral: float, speed: float = 4.0) -> Motion:
    """At that place in the end, along the track at that speed [m/s]."""
    return lambda t: (s + speed * t, lateral)


def moving(s: float, start: float, end: float, speed: float = 4.0) -> Motion:
    """To the side, from one place to the other, in the last 0.5 s."""
    return lambda t: (s + speed * t, end + (start - end) * min(1.0, -t / 0.5))


def test_the_lines_of_the_oval() -> None:
    assert OVAL.length == pytest.approx(2.0 * (STRAIGHT + TURN), abs=0.01)
    assert OVAL.project(*OVAL.pose_at(STRAIGHT + TURN / 2, 0.3)[:2]) == pytest.approx(
        (STRAIGHT + TURN / 2, 0.3), abs=0.01
    )


@pytest.mark.parametrize("lateral", [0.0, 0.2])
def test_rear_end_the_one_behind_pays(lateral: float) -> None:
    assert judge(at(10.0, lateral), at(9.5, 0.0, 6.0)) == Fault("rear end", (1,))
    assert judge(at(0.1, lateral), at(-0.4, 0.0, 6.0)) == Fault("rear end", (1,))  # across the start line


def test_shared_incident_both_pay_if_neither_or_both_moved_to_the_side() -> None:
    assert judge(at(10.0, 0.14), at(10.1, -0.14)) == Fault("shared incident", (0, 1))
    assert judge(moving(10.0, 0.3, 0.14), moving(10.1, -0.3, -0.14)) == Fault("shared incident", (0, 1))


def test_unsafe_lateral_movement_the_one_that_moved_pays() -> None:
    # side by side
    assert judge(at(10.0, 0.14), moving(10.1, -0.5, -0.14)) == Fault("unsafe lateral movement", (1,))
    # the one ahead cuts in before the nose of the one behind
    assert judge(moving(10.0, 0.5, 0.1), at(9.6, 0.0, 6.0)) == Fault("unsafe lateral movement", (0,))
    # the one behind that moves over hits the other from behind
    assert judge(at(10.0, 0.1), moving(9.6, -0.5, 0.0, 6.0)) == Fault("rear end", (1,))
    # a movement of less than 0.15 m in 0.5 s is none
    assert judge(at(10.0, 0.14), moving(10.1, -0.28, -0.14)) == Fault("shared incident", (0, 1))


def test_late_braking_dive_the_one_inside_pays_unless_it_was_alongside_at_the_entry() -> None:
    place = STRAIGHT + 3.0
    # at the entry, 3 m or 0.75 s before the contact, the faster one is 0.75 s x 2 m/s - 0.1 m behind, without overlap
    assert judge(at(place, -0.1), at(place - 0.1, 0.2, 6.0)) == Fault("late-braking dive", (1,))
    # the outside is no dive: a contact side by side
    assert judge(at(place, 0.2), at(place - 0.1, -0.1, 6.0)) == Fault("shared incident", (0, 1))
    # alongside at the entry: it has a right to its line, and the other turns in on it
    assert judge(moving(place, -0.5, -0.1), at(place - 0.1, 0.2, 4.2)) == Fault("unsafe lateral movement", (0,))
    # on a straight there is no corner
    assert judge(at(10.0, -0.1), at(9.9, 0.2, 6.0)) == Fault("shared incident", (0, 1))


@pytest.mark.parametrize("place", [STRAIGHT + 0.75 * TURN, STRAIGHT + TURN + 1.0])
def test_squeeze_the_one_inside_that_drifts_out_at_the_exit_pays(place: float) -> None:
    assert judge(moving(place, 0.2, -0.3), at(place + 0.1, -0.6)) == Fault("squeeze at the exit of a corner", (0,))
    # the one outside that moves in does not squeeze
    assert judge(at(place, 0.2), moving(place + 0.1, -0.5, -0.1)) == Fault("unsafe lateral movement", (1,))


def test_the_entry_of_a_corner_and_the_end_of_its_exit_are_no_squeeze() -> None:
    for place in (STRAIGHT + 0.25 * TURN, STRAIGHT + TURN + 3.0):
        assert judge(moving(place, 0.2, -0.3), at(place + 0.1, -0.6)) == Fault("unsafe lateral movement", (0,))


def test_unsafe_rejoin_the_one_that_was_beyond_the_edge_pays() -> None:
    def outside(since: float) -> Motion:
        return lambda t: (10.0 + 2.0 * t, WIDTH + 0.1 if t < since else 0.1)

    assert judge(outside(-1.5), at(9.5, 0.0, 6.0)) == Fault("unsafe rejoin", (0,))
    assert judge(outside(-2.5), at(9.5, 0.0, 6.0)) == Fault("rear end", (1,))


@pytest.mark.parametrize(("after", "guilty"), [(1.0, "V1"), (2.9, "V1"), (3.2, "V2")])
def test_a_car_that_drives_on_after_a_set_back_rejoins_for_two_seconds(after: float, guilty: str) -> None:
    """V1 hits the wall at 1 s and stands for 1 s; then V2 hits it from behind, `after` seconds after the wall."""
    rules = RaceRules(
        collision_penalty=10.0, is_set_back=True, restart_delay=1.0, vehicle_contact="judged", race_laps=9
    )
    race = Race(["V1", "V2"], OVAL, rules, TICK)

    def positions(first: float, second: float) -> np.ndarray:
        return np.array([(*OVAL.pose_at(s)[:2], 0.0) for s in (first, second)])

    race.reset(positions(3.0, 0.0))
    hit = (Collision(1.0, "V1", "wall", 1.0, np.zeros(3)),)
    touch = (Collision(0.0, "V1", "V2", 1.0, np.zeros(3)), Collision(0.0, "V2", "V1", 1.0, np.zeros(3)))
    penalties = []
    end = round((1.0 + after) / TICK)
    for tick in range(1, end + 1):
        time = tick * TICK
        place = positions(3.0, 2.5 - 0.01 * (end - tick))
        happened = hit if tick == round(1.0 / TICK) else touch if tick == end else ()
        events, moves = race.judge(time, place, happened)
        penalties += [(one.vehicle, one.reason) for one in events if isinstance(one, RacePenalty)]
        for move in moves:
            race.moved(move.vehicle, place)
    reason = "unsafe rejoin: contact with V2" if guilty == "V1" else "rear end: contact with V1"
    assert penalties == [("V1", "collision with wall"), (guilty, reason)]


def test_what_was_before_a_car_was_placed_elsewhere_does_not_count() -> None:
    contacts = ContactJudge(OVAL, 2, TICK)
    for k in range(-40, 1):
        if k == -5:
            contacts.placed(1)
        lateral = -0.6 if k < -5 else -0.14
        contacts.note(k * TICK, np.array([10.0, 10.1]), np.array([0.14, lateral]))
    assert contacts.fault(0, 1) == Fault("shared incident", (0, 1))


def test_the_rules_of_the_package_judge_a_head_to_head() -> None:
    assert load_rules("head_to_head").vehicle_contact == "judged"
