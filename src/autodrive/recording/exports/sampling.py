"""Moments of a recording at a rate."""

from __future__ import annotations

from collections.abc import Iterator

from autodrive.recording import Moment, Recording
from autodrive.recording.exports.options import ExportOptions


def sampled(recording: Recording, options: ExportOptions, rate: float | None) -> Iterator[Moment]:
    """The Frames in the range of the options, at most `rate` of them in a second; None: all.

    A Frame that a request made between two ticks is replaced by the one after it, so that times increase.
    """
    due: float | None = None
    last: Moment | None = None
    for moment in recording.moments(options.start, options.end):
        if last is not None and moment.time > last.time and (due is None or last.time >= due - 1e-9):
            yield last
            period = 0.0 if rate is None else 1.0 / rate
            due = (last.time if due is None else max(due, last.time - period)) + period
        last = moment
    if last is not None and (due is None or last.time >= due - 1e-9):
        yield last
