"""State of the lamps: section 3.1.4 of the report as a truth table."""

import itertools

import pytest

from autodrive.physics.actuators.lights import lit_lamps
from autodrive.protocol.messages import Headlights, Indicators, Lights, TailLights

SIDES = {
    Indicators.OFF: (False, False),
    Indicators.LEFT: (True, False),
    Indicators.RIGHT: (False, True),
    Indicators.HAZARD: (True, True),
}
"""Which indicators blink: left, right."""


@pytest.mark.parametrize(("headlights", "indicators"), [*itertools.product(Headlights, Indicators)])
def test_each_lamp_depends_only_on_its_own_inputs(headlights: Headlights, indicators: Indicators) -> None:
    """Tail lights are bright when braking; indicators are on in the second half of the period."""
    phases = (0.0, 0.01, 0.499, 0.5, 0.51, 0.999)
    for phase, is_braking, is_reversing in itertools.product(phases, (False, True), (False, True)):
        dim = TailLights.OFF if headlights == Headlights.OFF else TailLights.PARTIAL
        left, right = SIDES[indicators] if phase >= 0.5 else (False, False)
        assert lit_lamps(headlights, indicators, phase, is_braking, is_reversing) == Lights(
            headlights=headlights,
            indicators=indicators,
            tail_lights=TailLights.BRIGHT if is_braking else dim,
            left_indicator=left,
            right_indicator=right,
            reverse_lights=is_reversing,
        )
