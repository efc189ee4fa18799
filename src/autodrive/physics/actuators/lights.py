"""Lamps: headlights and indicators follow commands, tail and reverse lights are automatic."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Annotated, TypeAlias

import numpy as np
from pydantic import Field

from autodrive.base.specs import Offset, Spec
from autodrive.protocol.messages import Headlights, Indicators, Lights, TailLights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats, Integers

Level: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]


class LampSpec(Spec):
    """A pair of equal lamps, left and right."""

    position: tuple[Offset, Offset, Offset]
    """Position of the left lamp in the vehicle frame [m]; the right lamp is its mirror image."""
    color: tuple[Level, Level, Level]
    """Linear RGB, each in [0, 1]."""
    range: float = Field(ge=1e-3, le=1e4)
    """Distance that the lamp illuminates [m]."""


class LightsSpec(Spec):
    """The lamps of a vehicle and the period of the indicators."""

    head: LampSpec
    """Headlights, which are on in low and high beam."""
    high_beam: LampSpec
    """Additional lamps, which are on in high beam only."""
    front_indicator: LampSpec
    rear_indicator: LampSpec
    tail: LampSpec
    reverse: LampSpec
    blink_period: float = Field(default=1.0, ge=0.01, le=1e3)
    """Period of the indicators [s]; they are off in the first half and on in the second."""


LAMPS = tuple(
    f"{lamp}_{side}"
    for lamp in ("head", "high_beam", "front_indicator", "rear_indicator", "tail", "reverse")
    for side in ("left", "right")
)
"""Names of all lamps of a vehicle: the field of `LightsSpec` and the side."""


def lamp_levels(lights: Lights) -> tuple[float, ...]:
    """Brightness of each of `LAMPS`, 0 to 1. Partial tail lights have half the brightness (scene)."""
    low, high = lights.headlights != Headlights.OFF, lights.headlights == Headlights.HIGH
    left, right = lights.left_indicator, lights.right_indicator
    tail, reverse = lights.tail_lights / TailLights.BRIGHT, lights.reverse_lights
    return tuple(map(float, (low, low, high, high, left, right, left, right, tail, tail, reverse, reverse)))


def lit_lamps(
    headlights: Headlights, indicators: Indicators, blink_phase: float, is_braking: bool, is_reversing: bool
) -> Lights:
    """State of the lamps. `blink_phase` in [0, 1) is the position in the blink period since the indicators went on."""
    is_bright = indicators != Indicators.OFF and blink_phase >= 0.5
    if is_braking:
        tail = TailLights.BRIGHT
    else:
        tail = TailLights.PARTIAL if headlights != Headlights.OFF else TailLights.OFF
    return Lights(
        headlights=headlights,
        indicators=indicators,
        tail_lights=tail,
        left_indicator=is_bright and indicators in (Indicators.LEFT, Indicators.HAZARD),
        right_indicator=is_bright and indicators in (Indicators.RIGHT, Indicators.HAZARD),
        reverse_lights=is_reversing,
    )


def lit_levels(
    headlights: Integers,
    indicators: Integers,
    blink_phase: Floats,
    is_braking: NDArray[np.bool_],
    is_reversing: NDArray[np.bool_],
) -> Floats:
    """Brightness of each of `LAMPS` in the state of `lit_lamps`, for arrays of the same shape: shape (..., lamps)."""
    numbers = headlights, indicators, blink_phase >= 0.5, is_braking, is_reversing
    return _levels()[tuple(np.asarray(number, np.intp) for number in numbers)]


@cache
def _levels() -> Floats:
    """`lamp_levels` of each state, by the arguments of `lit_lamps`, shape (3, 4, 2, 2, 2, lamps)."""
    states = product(Headlights, Indicators, (0.0, 0.5), (False, True), (False, True))
    levels = [lamp_levels(lit_lamps(*state)) for state in states]
    return np.reshape(levels, (len(Headlights), len(Indicators), 2, 2, 2, len(LAMPS)))
