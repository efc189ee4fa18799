"""Lamps: headlights and indicators as told, tail and reverse lights by themselves."""

from __future__ import annotations

from pydantic import Field

from autodrive.descriptions import Spec
from autodrive.protocol.messages import Headlights, Indicators, Lights, TailLights

Point = tuple[float, float, float]


class LampSpec(Spec):
    """A pair of equal lamps, left and right of the middle."""

    position: Point
    """The left one, in the vehicle frame [m]; the right one mirrors it."""
    color: tuple[float, float, float]
    """Linear RGB, each in [0, 1]."""
    range: float = Field(gt=0)
    """How far it lights its surroundings [m]."""


class LightsSpec(Spec):
    """The lamps of a vehicle and how they blink."""

    head: LampSpec
    """Lit in low and high beam."""
    high_beam: LampSpec
    """Lit in high beam only."""
    front_indicator: LampSpec
    rear_indicator: LampSpec
    tail: LampSpec
    reverse: LampSpec
    blink_period: float = Field(default=1.0, gt=0)
    """Indicators: dark for the first half of it, lit for the second [s]."""


LAMPS = tuple(
    f"{lamp}_{side}"
    for lamp in ("head", "high_beam", "front_indicator", "rear_indicator", "tail", "reverse")
    for side in ("left", "right")
)
"""Every lamp of a vehicle, by the names of `LightsSpec` and the side that it is on."""


def lamp_levels(lights: Lights) -> tuple[float, ...]:
    """How brightly each of `LAMPS` burns, 0 to 1. Tail lights burn at half when partial (scene)."""
    low, high = lights.headlights != Headlights.OFF, lights.headlights == Headlights.HIGH
    left, right = lights.left_indicator, lights.right_indicator
    tail, reverse = lights.tail_lights / TailLights.BRIGHT, lights.reverse_lights
    return tuple(map(float, (low, low, high, high, left, right, left, right, tail, tail, reverse, reverse)))


def lit_lamps(
    headlights: Headlights, indicators: Indicators, blink_phase: float, is_braking: bool, is_reversing: bool
) -> Lights:
    """What the lamps do. `blink_phase` in [0, 1) is the place in the blink period, counted from switching on."""
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
