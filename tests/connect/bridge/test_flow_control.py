"""Flow control against the ways in which scripts answer, with explicit times."""

from __future__ import annotations

import pytest

from autodrive.connect.bridge.flow_control import PATIENCE, RESEND_DELAY, RESEND_DELAY_MAX, FlowControl
from autodrive.protocol.messages import Frame


def new_frame() -> Frame:
    return Frame(time=0.0, tick=0, vehicles={}, objects={}, events=(), scene_light=True)


def after_one_exchange(now: float = 0.0) -> tuple[FlowControl, Frame]:
    """State after one telemetry message that was answered and acknowledged at once."""
    flow, frame = FlowControl(), new_frame()
    number = flow.begin_send(frame, now, may_request_ack=True)
    assert number is not None
    flow.command_received(now)
    flow.ack_received(number)
    return flow, frame


def test_the_first_telemetry_is_sent_at_once() -> None:
    assert FlowControl().should_send(new_frame(), 0.0)


def test_without_a_command_nothing_is_sent_until_the_resend_delay() -> None:
    flow, frame = FlowControl(), new_frame()
    flow.begin_send(frame, 0.0, may_request_ack=True)
    assert not flow.should_send(new_frame(), 0.99 * RESEND_DELAY)
    assert flow.should_send(frame, RESEND_DELAY)


def test_a_command_requests_one_telemetry_message_of_a_newer_frame() -> None:
    flow, frame = after_one_exchange()
    assert not flow.should_send(frame, 0.01)
    assert flow.awaits_frame
    newer = new_frame()
    assert flow.should_send(newer, 0.01)
    flow.begin_send(newer, 0.01, may_request_ack=True)
    assert not flow.is_resend
    assert not flow.should_send(new_frame(), 0.02)


def test_the_resend_delay_grows_up_to_its_limit() -> None:
    flow = FlowControl()
    now, pauses = 0.0, []
    for _ in range(6):
        flow.begin_send(new_frame(), now, may_request_ack=False)
        pauses.append(flow.deadline - now)
        now = flow.deadline
    # the third ends when the format of scans changes
    assert pauses == [RESEND_DELAY, 2 * RESEND_DELAY, PATIENCE - 3 * RESEND_DELAY, *[RESEND_DELAY_MAX] * 3]
    assert flow.resends == 5
    flow.command_received(now)
    assert flow.resends == 0


def test_the_format_changes_only_after_four_and_a_half_seconds_without_an_answer() -> None:
    flow = FlowControl()
    now, sent = 0.0, []
    for _ in range(6):
        flow.begin_send(new_frame(), now, may_request_ack=False)
        sent.append((now, flow.late_resends))
        now = flow.deadline
    assert sent == [(0.0, 0), (1.0, 0), (3.0, 0), (4.5, 1), (8.5, 2), (12.5, 3)]
    flow.command_received(now)
    assert flow.late_resends == 0


def test_a_slow_script_is_given_twice_its_last_round_trip_time() -> None:
    flow = FlowControl()
    flow.begin_send(new_frame(), 0.0, may_request_ack=False)
    flow.begin_send(new_frame(), 1.0, may_request_ack=False)
    assert flow.command_received(1.5) == 1.5  # since the first message, not since the resend
    flow.begin_send(new_frame(), 2.0, may_request_ack=False)
    assert flow.deadline == 5.0


def test_while_paused_the_state_is_sent_again_without_counting_a_missing_command() -> None:
    flow, frame = after_one_exchange()
    assert flow.should_send(frame, RESEND_DELAY)
    flow.begin_send(frame, RESEND_DELAY, may_request_ack=True)
    assert (flow.is_resend, flow.resends) == (True, 0)


def test_commands_for_another_simulator_do_not_queue_telemetry() -> None:
    """Two simulators at one server that broadcasts its replies: at most two messages of ours are unprocessed."""
    flow, _ = after_one_exchange()
    waiting: list[int] = []
    for step in range(100):  # a command every 10 ms; the server processes our messages every fifth time
        now = 0.01 * (step + 1)
        if step % 5 == 0 and waiting:
            flow.ack_received(waiting.pop(0))
        flow.command_received(now)
        if flow.should_send(new_frame(), now):
            number = flow.begin_send(new_frame(), now, may_request_ack=True)
            assert number is not None
            waiting.append(number)
        assert len(waiting) <= 2


def test_a_server_that_never_acknowledges_is_not_asked_again() -> None:
    flow, now, asked = FlowControl(), 0.0, []
    for _ in range(50):
        now = now if flow.should_send(new_frame(), now) else flow.deadline
        asked.append(flow.begin_send(new_frame(), now, may_request_ack=True) is not None)
        flow.command_received(now)
    assert sum(asked) == 4
    assert not any(asked[10:])
    assert now == pytest.approx(2 * RESEND_DELAY)  # the whole delay


def test_a_server_that_ignores_messages_with_acknowledgement_is_not_asked_again() -> None:
    flow, now = FlowControl(), 0.0
    for _ in range(50):
        now = now if flow.should_send(new_frame(), now) else flow.deadline
        if flow.begin_send(new_frame(), now, may_request_ack=True) is None:
            flow.command_received(now)
    assert now == pytest.approx(3 * RESEND_DELAY)  # the whole delay: after the first timeout it might be a slow script
