"""Whose turn it is between us and a devkit script: a telemetry asks for a command, a command asks for a telemetry."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame

SILENCE, SILENCE_MAX = 1.0, 4.0
"""The state is sent again after the first [s], then after twice as long, and so on up to the second: a script that
stands at a breakpoint shall not find a hundred old states when it goes on."""


class Turns:
    """Says when to send. No clock and no socket; times are those of any steady clock [s].

    We answer a command with the latest state, at most once a Frame. Replies of a Socket.IO server go to all its
    clients, so with two simulators a command may answer the other one; answering each would pile up messages without
    end. So the server is also asked to acknowledge our telemetry, and at most the latest is still unacknowledged when
    the next is sent. A server that never acknowledges is soon no longer asked.
    """

    def __init__(self) -> None:
        self.has_answer = False
        """Whether any command came."""
        self.silences = 0
        """Telemetry sent again since the last command."""
        self.is_repeat = False
        """Whether the latest telemetry was sent because time had passed, not because it was asked for."""
        self._frame: Frame | None = None
        self._sent_at = -math.inf
        self._asked_at = -math.inf
        self._round_trip = 0.0
        self._is_answered = False
        self._number = 0
        self._unacknowledged: list[int] = []
        self._has_acknowledged = False
        self._gave_up = 0

    @property
    def awaits_frame(self) -> bool:
        """Whether only a new Frame is wanting."""
        return self._is_answered and len(self._unacknowledged) < 2

    @property
    def deadline(self) -> float:
        """When the silence will have been too long, for a script that has taken as long as this one for its answers."""
        return self._sent_at + min(max(SILENCE, 2.0 * self._round_trip) * 2.0**self.silences, SILENCE_MAX)

    def is_ours(self, frame: Frame, now: float) -> bool:
        """Whether to send that Frame now."""
        return self._is_asked_for(frame) or now >= self.deadline

    def begin(self, frame: Frame, now: float, *, may_ask: bool) -> int | None:
        """We send that Frame now. Returns the number under which the server shall acknowledge it, if it shall."""
        self.is_repeat = self._frame is not None and not self._is_asked_for(frame)
        if self.is_repeat:
            self.silences += not self._is_answered
            self._gave_up += bool(self._unacknowledged)
            self._unacknowledged.clear()
        if self._is_answered or self._frame is None:
            self._asked_at = now
        self._frame, self._sent_at, self._is_answered = frame, now, False
        self._number += 1
        if not may_ask or self.is_repeat or (self._gave_up >= 2 and not self._has_acknowledged):
            return None
        self._unacknowledged.append(self._number)
        return self._number

    def acknowledged(self, number: int) -> None:
        """The server has done its work on the telemetry of that number."""
        self._has_acknowledged = True
        self._unacknowledged = [waiting for waiting in self._unacknowledged if waiting > number]

    def answered(self, now: float) -> float | None:
        """A command came. Returns the time since it was asked for [s], None if it was not."""
        is_first = not self._is_answered and self._frame is not None
        self.has_answer = self._is_answered = True
        self.silences = 0
        if not is_first:
            return None
        self._round_trip = now - self._asked_at
        return self._round_trip

    def _is_asked_for(self, frame: Frame) -> bool:
        return self.awaits_frame and frame is not self._frame
