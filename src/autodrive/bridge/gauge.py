"""How the bridge to a devkit script stands, with rates over the last second."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from autodrive.protocol.native import BridgeStatus

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge

LOOK_BACK = 1.0
"""Rates are of that time [s]."""


class Gauge:
    """Reads a bridge's counters now and then. Times are those of any steady clock [s]."""

    def __init__(self, bridge: DevkitBridge) -> None:
        self._bridge = bridge
        self._samples: deque[tuple[float, int, int]] = deque(maxlen=1000)

    def read(self, now: float) -> BridgeStatus:
        """What there is to tell now."""
        bridge = self._bridge
        counters = bridge.counters
        self._samples.append((now, counters.telemetry_sent, counters.commands_received))
        while len(self._samples) > 2 and self._samples[1][0] <= now - LOOK_BACK:
            self._samples.popleft()
        then, sent, received = self._samples[0]
        duration = max(now - then, 1e-3)
        return BridgeStatus(
            address=bridge.address,
            state=bridge.status,
            fault=bridge.fault,
            telemetry_rate=(counters.telemetry_sent - sent) / duration,
            command_rate=(counters.commands_received - received) / duration,
            round_trip=None if math.isnan(counters.round_trip) else counters.round_trip,
        )
