"""Refuses a second thread: compiled code and the engine share memory, which only one thread at a time may use."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Concatenate, ParamSpec, TypeVar

from autodrive.base.errors import CommandError, WorldInUseError


class OneThread:
    """Base of a class with methods that are marked with `by_one_thread`."""

    def __init__(self) -> None:
        self._in_use = threading.RLock()
        """Held by the thread that is inside a method; no thread waits for it."""
        self._is_closed = False

    def _check_open(self) -> None:
        if self._is_closed:
            raise CommandError(f"this {type(self).__name__} is closed: make a new one")


User = TypeVar("User", bound=OneThread)
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def by_one_thread(
    method: Callable[Concatenate[User, Parameters], Result],
) -> Callable[Concatenate[User, Parameters], Result]:
    """Raises `WorldInUseError` at once, and does nothing, while another thread is inside such a method."""

    @functools.wraps(method)
    def guarded(self: User, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        if not self._in_use.acquire(False):
            raise WorldInUseError(
                f"{type(self).__name__}.{method.__name__} was called while another thread is inside this "
                f"{type(self).__name__}: let one thread at a time use it, or use a Simulation, whose methods may be "
                "called from any thread"
            )
        try:
            return method(self, *args, **kwargs)
        finally:
            self._in_use.release()

    return guarded
