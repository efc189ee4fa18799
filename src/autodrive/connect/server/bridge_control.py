"""Connects and disconnects the bridge to a devkit script, and measures its message rates."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.protocol.native import BridgeStatus

if TYPE_CHECKING:
    from autodrive.connect.bridge.devkit import DevkitBridge

WINDOW = 1.0
"""Rates are averages over this time [s]."""


class BridgeControl:
    """Controls a bridge; None: each operation raises `AutodriveError`."""

    def __init__(self, bridge: DevkitBridge | None) -> None:
        self._bridge = bridge
        self._rate_meter = RateMeter(bridge) if bridge is not None else None
        self._lock = asyncio.Lock()

    async def connect(self, host: str, port: int) -> None:
        """Connect to the devkit script at that address, now or as soon as it listens."""
        bridge = self._required()
        async with self._lock:
            bridge.connect(host, port)
            if bridge.status == "closed":
                bridge.start()

    async def disconnect(self) -> None:
        """Close the connection, or stop trying to connect."""
        bridge = self._required()
        async with self._lock:
            await asyncio.to_thread(bridge.close)

    def status(self, now: float) -> BridgeStatus:
        """State and rates of the bridge."""
        return self._rate_meter.read(now) if self._rate_meter is not None else BridgeStatus()

    def _required(self) -> DevkitBridge:
        if self._bridge is None:
            raise AutodriveError("this simulator was started without a bridge to devkit scripts")
        return self._bridge


class RateMeter:
    """Computes rates from a bridge's counters. Times are those of any steady clock [s]."""

    def __init__(self, bridge: DevkitBridge) -> None:
        self._bridge = bridge
        self._samples: deque[tuple[float, int, int]] = deque(maxlen=1000)

    def read(self, now: float) -> BridgeStatus:
        """The status now, with rates since about `WINDOW` ago."""
        bridge = self._bridge
        counters = bridge.counters
        self._samples.append((now, counters.telemetry_sent, counters.commands_received))
        while len(self._samples) > 2 and self._samples[1][0] <= now - WINDOW:
            self._samples.popleft()
        then, sent, received = self._samples[0]
        duration = max(now - then, 1e-3)
        return BridgeStatus(
            address=bridge.address,
            state=bridge.status,
            error=bridge.error,
            telemetry_rate=(counters.telemetry_sent - sent) / duration,
            command_rate=(counters.commands_received - received) / duration,
            round_trip=None if math.isnan(counters.round_trip) else counters.round_trip,
            devkit=counters.devkit if bridge.status == "connected" else "",
            note=counters.note if bridge.status == "connected" else "",
        )
