"""Fixtures of the tests of replays: the recorded drive of the tests of recordings."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from autodrive.recording.replay.tape import Tape
from tests.recording.conftest import Drive, drive

__all__ = ["drive"]


@pytest.fixture
def tape(drive: Drive) -> Iterator[Tape]:
    with Tape(drive.path) as opened:
        yield opened
