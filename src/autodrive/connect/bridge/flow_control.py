"""Flow control for the devkit protocol: at most one telemetry message waits for a command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame

RESEND_DELAY, RESEND_DELAY_MAX = 1.0, 4.0
"""Wall time without a command after which telemetry is resent [s]: the first delay, which doubles up to the second. A
script that stops at a breakpoint then does not find a hundred old messages when it continues."""

PATIENCE = 4.5
"""A message that has not been answered for this time [s] is sent again in another format of scans: before that, the
script may be busy with its first answer, and would read the other format as garbage."""


class FlowControl:
    """Decides when to send telemetry. Uses no clock and no socket; `now` is the time of any monotonic clock [s].

    Each command is answered with the latest state, at most once per Frame. A Socket.IO server broadcasts its replies,
    so with two simulators a command may be the reply to the other one; answering each command would queue messages
    without limit. Therefore the server is also asked to acknowledge telemetry, and the next message is sent only if at
    most one is not acknowledged. A server that never acknowledges is not asked any more.

    `resend_delay` replaces `RESEND_DELAY` [s].
    """

    def __init__(self, resend_delay: float = RESEND_DELAY) -> None:
        self._resend_delay = resend_delay
        self.has_command = False
        """Whether any command was received."""
        self.resends = 0
        """Number of resent messages since the last command."""
        self.late_resends = 0
        """Number of those after `PATIENCE`."""
        self.is_resend = False
        """Whether the latest telemetry message was a resend after a timeout."""
        self._frame: Frame | None = None
        self._sent_at = -math.inf
        self._requested_at = -math.inf
        self._round_trip = 0.0
        self._is_answered = False
        self._number = 0
        self._unacknowledged: list[int] = []
        self._has_ack = False
        self._ack_timeouts = 0

    @property
    def awaits_frame(self) -> bool:
        """Whether telemetry is sent as soon as there is a new Frame."""
        return self._is_answered and len(self._unacknowledged) < 2

    @property
    def deadline(self) -> float:
        """Time of the next resend; a script that answers slowly is given twice its last round-trip time."""
        first, longest = self._resend_delay, max(self._resend_delay, RESEND_DELAY_MAX)
        due = self._sent_at + min(max(first, 2.0 * self._round_trip) * 2.0**self.resends, longest)
        patience_ends = self._requested_at + PATIENCE
        return min(due, patience_ends) if self._sent_at < patience_ends and not self.has_command else due

    def should_send(self, frame: Frame, now: float) -> bool:
        """Whether to send that Frame now."""
        return self._is_requested(frame) or now >= self.deadline

    def begin_send(self, frame: Frame, now: float, *, may_request_ack: bool) -> int | None:
        """Record that the Frame is sent now. Returns the acknowledgement number to request; None: request none."""
        self.is_resend = self._frame is not None and not self._is_requested(frame)
        if self.is_resend:
            self.resends += not self._is_answered
            self.late_resends += not self._is_answered and now >= self._requested_at + PATIENCE
            self._ack_timeouts += bool(self._unacknowledged)
            self._unacknowledged.clear()
        if self._is_answered or self._frame is None:
            self._requested_at = now
        self._frame, self._sent_at, self._is_answered = frame, now, False
        self._number += 1
        if not may_request_ack or self.is_resend or (self._ack_timeouts >= 2 and not self._has_ack):
            return None
        self._unacknowledged.append(self._number)
        return self._number

    def ack_received(self, number: int) -> None:
        """The server has processed the telemetry message with that number."""
        self._has_ack = True
        self._unacknowledged = [waiting for waiting in self._unacknowledged if waiting > number]

    def command_received(self, now: float) -> float | None:
        """A command was received. Returns the round-trip time [s]; None if it answers no telemetry message."""
        is_first = not self._is_answered and self._frame is not None
        self.has_command = self._is_answered = True
        self.resends = self.late_resends = 0
        if not is_first:
            return None
        self._round_trip = now - self._requested_at
        return self._round_trip

    def _is_requested(self, frame: Frame) -> bool:
        return self.awaits_frame and frame is not self._frame
