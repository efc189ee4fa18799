"""Manoeuvres that separate parameters which a drive cannot tell apart."""

from __future__ import annotations

from collections.abc import Mapping

MANOEUVRES: Mapping[str, str] = {
    "steps": "steps of the steering between both ends at two speeds, with commands recorded at 50 Hz or more",
    "circles": "speed up on circles of a constant angle until the car slides, to both sides",
    "slow": "slow circles at several angles to each side, and 10 s straight ahead with the command 0",
    "coasting": "coasting without throttle from full speed to rest, straight ahead",
    "throttle": "steps of the throttle from rest to several values, straight ahead, each until the speed is steady",
}
"""What to drive, by name."""
SEPARATED_BY: tuple[tuple[str, str], ...] = (
    ("steering.dead_time", "steps"),
    ("steering.rate_limit", "steps"),
    ("steering.time_constant", "steps"),
    ("body.inertia", "steps"),
    ("wheels.rolling_resistance", "coasting"),
    ("body.drag", "coasting"),
    ("wheels.steering_resistance", "slow"),
    ("wheels.magic_formula", "circles"),
    ("wheels.sideways_friction", "circles"),
    ("steering", "slow"),
    ("drivetrain", "throttle"),
)
"""Beginnings of paths, and the manoeuvre that shows them; the first one that fits counts."""


def manoeuvre_for(path: str) -> str:
    """Name of the manoeuvre that shows a parameter."""
    return next((name for beginning, name in SEPARATED_BY if path.startswith(beginning)), "throttle")


def advice(first: str, second: str) -> str:
    """What to drive to tell two parameters apart."""
    return "; ".join(MANOEUVRES[name] for name in dict.fromkeys((manoeuvre_for(first), manoeuvre_for(second))))
