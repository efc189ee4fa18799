"""Drives of a devkit script in lock-step: they do not depend on how fast the machine is."""

from __future__ import annotations

from collections.abc import Iterator

from autodrive import Frame, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.protocol.messages import Step
from tests.support.waiting import wait_until


def answered_ticks(simulation: Simulation, bridge: DevkitBridge) -> Iterator[Frame]:
    """Frames of a paused simulation, without end; each tick waits for the script's answer to the previous one."""
    wait_until(lambda: bridge.counters.commands_received)
    while True:
        answered = bridge.counters.commands_received
        frame = simulation.request(Step()).result()
        assert isinstance(frame, Frame)
        yield frame
        wait_until(lambda answered=answered: bridge.counters.commands_received > answered)
