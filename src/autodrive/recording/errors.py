"""Errors of recordings."""

from __future__ import annotations

from autodrive.base.errors import AutodriveError


class RecordingError(AutodriveError):
    """A recording cannot be written, read or simulated again; the message says why."""
