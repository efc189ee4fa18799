"""Errors that a user can fix: all exceptions that this package raises on purpose are an `AutodriveError`."""

from __future__ import annotations


class AutodriveError(Exception):
    """Base of all errors that a user can fix; the message states what is wrong, where, and what would be right."""


class SpecError(AutodriveError, ValueError):
    """A file (vehicle, module, map or scenario) or a Spec is wrong. Holds all errors.

    `errors` is the list of messages; the text of the exception contains all of them (at most 200), then the path of the
    file.
    """

    def __init__(self, errors: list[str], path: str = "") -> None:
        if not isinstance(errors, list):  # multiprocessing and Gymnasium make a new one of a text or an exception
            errors = [str(errors)]
        self.errors = errors
        self.path = path
        lines = errors if len(errors) == 1 else [f"{len(errors)} errors:", *(f"  - {error}" for error in errors[:200])]
        if len(errors) > 200:
            lines.append(f"  - and {len(errors) - 200} more")
        super().__init__("\n".join(lines) + (f"  ({path})" if path else ""))

    def __reduce__(self) -> tuple[type[SpecError], tuple[list[str], str]]:
        """Class and arguments for pickle, because the argument of the constructor is not the text of the error."""
        return type(self), (self.errors, self.path)


class CommandError(AutodriveError):
    """A command is invalid: it is not a `Command`, its vehicle is unknown, or a value is not a finite number."""


class NoImageError(AutodriveError, KeyError):
    """A camera has no image: the cameras are off, there is no such camera, or its first image is not ready."""

    __str__ = Exception.__str__  # that of KeyError puts the message in quotes


class EngineError(AutodriveError):
    """The physics engine cannot continue, for example because the state is no longer finite."""


class SensorError(AutodriveError):
    """A sensor of the user raised an error, or returned something else than a number for each of its columns."""


class SnapshotError(AutodriveError):
    """A snapshot does not fit the world that it is given to, or has been changed since `World.save`."""


class WorldInUseError(AutodriveError):
    """Another thread is inside the `World`; only one thread at a time may use it."""
