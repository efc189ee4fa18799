"""State of the lamps: section 3.1.4 of the report as a truth table."""

import itertools

import pytest

from autodrive.physics.actuators.lights import lit_lamps
from autodrive.protocol.messages import Headlights, Indicators, TailLights

ALL = list(itertools.product(Headlights, Indicators, (0.0, 0.25, 0.5, 0.75), (False, True), (False, True)))


@pytest.mark.parametrize(
    ("headlights", "is_braking", "expected"),
    [
        (Headlights.OFF, False, TailLights.OFF),
        (Headlights.LOW, False, TailLights.PARTIAL),
        (Headlights.HIGH, False, TailLights.PARTIAL),
        (Headlights.OFF, True, TailLights.BRIGHT),
        (Headlights.LOW, True, TailLights.BRIGHT),
        (Headlights.HIGH, True, TailLights.BRIGHT),
    ],
)
def test_tail_lights_are_bright_when_braking_and_otherwise_follow_the_headlights(
    headlights: Headlights, is_braking: bool, expected: TailLights
) -> None:
    assert lit_lamps(headlights, Indicators.OFF, 0.0, is_braking, False).tail_lights == expected


@pytest.mark.parametrize(
    ("indicators", "left", "right"),
    [
        (Indicators.OFF, False, False),
        (Indicators.LEFT, True, False),
        (Indicators.RIGHT, False, True),
        (Indicators.HAZARD, True, True),
    ],
)
def test_indicators_are_off_in_the_first_half_of_the_period_and_on_in_the_second(
    indicators: Indicators, left: bool, right: bool
) -> None:
    for phase in (0.0, 0.01, 0.499):
        lamps = lit_lamps(Headlights.OFF, indicators, phase, False, False)
        assert not lamps.left_indicator
        assert not lamps.right_indicator
    for phase in (0.5, 0.51, 0.999):
        lamps = lit_lamps(Headlights.OFF, indicators, phase, False, False)
        assert (lamps.left_indicator, lamps.right_indicator) == (left, right)


def test_each_lamp_depends_only_on_its_own_inputs() -> None:
    for headlights, indicators, phase, is_braking, is_reversing in ALL:
        lamps = lit_lamps(headlights, indicators, phase, is_braking, is_reversing)
        assert lamps.headlights == headlights
        assert lamps.indicators == indicators
        assert lamps.reverse_lights == is_reversing
        assert lamps.tail_lights == lit_lamps(headlights, Indicators.OFF, 0.0, is_braking, False).tail_lights
        blinking = lit_lamps(Headlights.OFF, indicators, phase, False, False)
        assert lamps.left_indicator == blinking.left_indicator
        assert lamps.right_indicator == blinking.right_indicator
