"""A day of driving in one World: no error, no more memory, the same bits again.

AUTODRIVE_HARDENING=long drives 24 simulated hours in one World, and an hour in others, instead of minutes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support import long_drive
from tests.support.command_line import python
from tests.support.hardening import cases
from tests.support.long_drive import SCENARIOS

pytestmark = pytest.mark.process

HOURS: dict[str, float] = cases({"day": 0.05}, {"day": 24.0, "loop": 1.0, "two cars": 1.0})
"""Simulated, by scenario."""
GROWTH = 1.05
"""Memory at the end, relative to that after a tenth of the drive."""


def driven(scenario: str, hours: float) -> dict[str, Any]:
    """The drive in a process of its own, whose memory is that of one World."""
    words = ("-W", "error", "-m", "tests.support.long_drive", scenario, hours)
    return json.loads(python(*words, limit=1e5, cwd=Path(__file__).parents[2]).splitlines()[-1])


@pytest.mark.parametrize("scenario", HOURS)
def test_a_long_drive_has_no_error_and_needs_no_more_memory(scenario: str) -> None:
    done = driven(scenario, HOURS[scenario])
    print(done)
    assert done["ticks"] == round(HOURS[scenario] * 3600 / SCENARIOS[scenario].tick)
    assert min(done[what] for what in ("contacts", "teleports")) > 0
    memory = done["memory"]
    assert max(memory[2:]) < GROWTH * memory[1]  # after a tenth
    assert done["threads"] <= 4
    assert done["descriptors"] < 20


@pytest.mark.parametrize("scenario", cases(["two cars"], [*SCENARIOS]))
def test_the_same_drive_in_two_processes_ends_with_the_same_bits(scenario: str) -> None:
    hours = cases(0.005, 0.5)
    first, second = driven(scenario, hours), long_drive.driven(scenario, hours)  # the other process is this one
    print(first["digest"], second["digest"])
    assert first["digest"] == second["digest"]
