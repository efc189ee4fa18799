"""The error that a conformance check raises."""

from __future__ import annotations

from autodrive.base.errors import AutodriveError


class ConformanceError(AutodriveError):
    """What a sensor or bridge does wrong; `errors` has one sentence for each."""

    def __init__(self, subject: str, errors: list[str]) -> None:
        self.errors = errors
        super().__init__("\n".join([f"{subject} does not conform:", *(f"  - {error}" for error in errors)]))
