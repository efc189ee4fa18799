"""The one way this package compiles Python: Numba, without the interpreter lock, cached on disk, no fast math.

With `NUMBA_DISABLE_JIT=1` in the environment the same source runs as plain Python and can be stepped through.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numba
from numba.core import config, event
from numba.core.dispatcher import Dispatcher

from autodrive.cache import cache_folder

Function = TypeVar("Function", bound=Callable[..., object])


# Numba itself looks only at the file of the outermost function, so that a change in a function which that one calls
# would go unnoticed: a folder for each state of our whole source
if "NUMBA_CACHE_DIR" not in os.environ:
    config.CACHE_DIR = str(cache_folder("numba"))  # pyright: ignore[reportAttributeAccessIssue]

_njit: Any = numba.njit


def jit(function: Function) -> Function:
    """Compile at the first call (or read from the cache). Same bits on every run: no fast math, no threads."""
    return _njit(function, cache=True, nogil=True, error_model="numpy", fastmath=False)


def inlined(function: Function) -> Function:
    """For the innermost loops: as `jit`, but LLVM copies the code into its callers, and arrays are not counted.

    A call with a whole Model and State would cost more than what it does, and so would counting the references to
    their arrays. Such a function, and a `jit_uncounted` one that calls it, cannot make arrays.
    """
    return _njit(function, cache=True, nogil=True, error_model="numpy", fastmath=False, forceinline=True, _nrt=False)


def jit_uncounted(function: Function) -> Function:
    """As `jit`, for the outermost of the functions above."""
    return _njit(function, cache=True, nogil=True, error_model="numpy", fastmath=False, _nrt=False)


def resolved(function: Function, *arguments: Any) -> Function:
    """The compiled code for arguments of these types, called without a look at the types.

    For what is called in every tick: Numba takes 10 us to look at a Model and a State, and 1.5 us to pass them.
    """
    dispatcher: Any = function
    if not isinstance(dispatcher, Dispatcher):  # compilation is switched off
        return function
    signature = tuple(numba.typeof(argument) for argument in arguments)
    dispatcher.compile(signature)
    compiled: Any = dispatcher.get_overload(signature)
    return compiled


@contextmanager
def compiling(progress: Callable[[str], None]) -> Iterator[None]:
    """Tells `progress` the name of every function that is compiled meanwhile, when it is done.

    Silent where all comes from the cache. The first run on a machine compiles for about a quarter of a minute.
    """
    with event.install_listener("numba:compile", _Compilations(progress)):
        yield


class _Compilations(event.Listener):
    def __init__(self, progress: Callable[[str], None]) -> None:
        self._progress = progress

    def on_start(self, event: Any) -> None:
        pass

    def on_end(self, event: Any) -> None:
        self._progress(event.data["dispatcher"].py_func.__name__.lstrip("_"))
