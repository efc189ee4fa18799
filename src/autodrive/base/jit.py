"""Compilation with Numba: without the interpreter lock, cached on disk, no fast math.

With `NUMBA_DISABLE_JIT=1` in the environment the same source runs as plain Python, for example in a debugger.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import inspect
import logging
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.np import linalg

from autodrive.base.cache import cache_folder, read_cached, sources, write_cached

Function = TypeVar("Function", bound=Callable[..., object])

log = logging.getLogger(__name__)


def _folder() -> Path:
    """A folder for each version of the compiler; see `_FileCache` for versions of the functions."""
    own = cache_folder("numba", also=f"{numba.__version__} {llvmlite.__version__}")
    return Path(os.environ["NUMBA_CACHE_DIR"], own.name) if os.environ.get("NUMBA_CACHE_DIR") else own


CACHE = _folder()
"""Folder of compiled functions: `NUMBA_CACHE_DIR`, or the user's cache folder."""


def jit(function: Function) -> Function:
    """Compile at the first call or load from the cache. Same bits in every run: no fast math, no threads."""
    return _cached(numba.njit(function, nogil=True, error_model="numpy", fastmath=False))


def inlined(function: Function) -> Function:
    """As `jit`, for inner loops: LLVM copies the code into the callers, and references to arrays are not counted.

    Passing a whole Model and State, and counting references to their arrays, would cost more than the function
    itself. Such a function, and a `jit_uncounted` function that calls it, cannot create arrays.
    """
    return _cached(inlined_part(function))


def inlined_part(function: Function) -> Function:
    """As `inlined`, for a function that is made in another one: it is not in the cache, only its callers are."""
    options: Any = {"forceinline": True, "_nrt": False}
    return numba.njit(function, nogil=True, error_model="numpy", fastmath=False, **options)  # pyright: ignore


def jit_uncounted(function: Function) -> Function:
    """As `jit`, without reference counting, for the outermost function that calls `inlined` functions."""
    options: Any = {"_nrt": False}
    return _cached(numba.njit(function, nogil=True, error_model="numpy", fastmath=False, **options))


def resolved(function: Function, *arguments: Any) -> Function:
    """The compiled code for arguments of these types, which is called without checking the types.

    For functions that are called in every tick: Numba needs 10 us to check a Model and a State, 1.5 us to pass them.
    """
    dispatcher: Any = function
    if not isinstance(dispatcher, Dispatcher):  # compilation is disabled
        return function
    signature = signature_of(arguments)
    if (wait := awaited.pop((dispatcher, signature), None)) is not None:
        wait()
    dispatcher.compile(signature)
    compiled: Any = dispatcher.get_overload(signature)
    return compiled


def signature_of(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """The types of the arguments."""
    return tuple(numba.typeof(argument) for argument in arguments)


def must_compile(function: Any, signature: tuple[Any, ...]) -> bool:
    """Whether a call with arguments of these types compiles code that the cache will hold."""
    if not isinstance(function, Dispatcher):  # compilation is disabled
        return False
    dispatcher: Any = function
    path = dispatcher._cache._path(signature, dispatcher.targetctx.codegen())
    return path is not None and not path.exists()


def show(function: str) -> None:
    """Call what `compiling` was given: a function is compiled."""
    for watcher in [*_watchers]:
        watcher(function)


@contextmanager
def compiling(progress: Callable[[str], None]) -> Iterator[None]:
    """Calls `progress` with the name of each function that is compiled inside the `with` block.

    Nothing is called if all functions are in the cache. The first run on a machine compiles for 20 to 70 s.
    """
    _watchers.append(progress)
    try:
        with event.install_listener("numba:compile", _Compilations(progress)):
            yield
    finally:
        _watchers.remove(progress)


@contextmanager
def announced() -> Iterator[None]:
    """Inside the `with` block, the first compilation in this process prints a line, unless `compiling` shows it."""

    def announce(_: str) -> None:
        if _watchers == [announce] and not announcements:
            announcements.append("compiling the physics for this machine, once: this takes 20 to 70 s")
            print(f"autodrive: {announcements[0]}", file=sys.stderr, flush=True)

    with compiling(announce):
        yield


awaited: dict[tuple[Dispatcher, Any], Callable[[], object]] = {}
"""Waits for another process that compiles a function for these types into the cache; see `compile_ahead`."""
_watchers: list[Callable[[str], None]] = []
"""What the `compiling` blocks call."""
announcements: list[str] = []
"""What was printed: one line at most."""


class _Compilations(event.Listener):
    def __init__(self, progress: Callable[[str], None]) -> None:
        self._progress = progress

    def on_start(self, event: Any) -> None:
        pass

    def on_end(self, event: Any) -> None:
        self._progress(event.data["dispatcher"].py_func.__name__.lstrip("_"))


# -- the cache ------------------------------------------------------------------------------------------------------


def _cached(dispatcher: Any) -> Any:
    if isinstance(dispatcher, Dispatcher):  # otherwise compilation is disabled
        dispatcher._cache = _FileCache(dispatcher.py_func)  # pyright: ignore[reportAttributeAccessIssue]
    return dispatcher


class _FileCache(FunctionCache):
    """A checked file for each function and its argument types; without a usable file, the function is compiled.

    The file is valid for one version of the function's module and of all modules that it imports, because a function
    also contains those that it calls.

    Numba's own cache raises for a damaged file or a full disk, and its index can be wrong after two processes have
    written it at once.
    """

    def __init__(self, function: Callable[..., object]) -> None:
        self._py_func = function  # for `_index_key`
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._cache_path = str(CACHE)
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        rtsys.initialize(target_context)  # the rest of `refresh` serves compilations, which call it themselves
        _import_array_functions()
        path = self._path(sig, target_context.codegen())
        if path is None:
            return None
        try:
            return CompileResult._rebuild(target_context, *pickle.loads(read_cached(path)))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            _warn(f"the cache of compiled code cannot be read: {error.strerror}; it is compiled again  ({path})")
        except Exception:  # unpickling may raise anything
            _warn(f"the cache of compiled code is damaged; what is damaged is compiled again  ({path})")
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        path = self._path(sig, data.codegen)
        if path is None or data.lifted or data.library.has_dynamic_globals:
            return
        try:
            write_cached(path, dumps(data._reduce()))
        except OSError as error:
            _warn(
                f"the cache of compiled code cannot be written: {error.strerror}; every start compiles again, unless "
                f"NUMBA_CACHE_DIR names another folder  ({CACHE})"
            )

    def flush(self) -> None:
        """Nothing: files of other sources have other names."""

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        """None: no name is certain, because the source cannot be read or a type is named by an address."""
        source = _source_digest(inspect.getfile(self._py_func))
        name = f"{self._name} {source} {self._index_key(sig, codegen)}"
        if not source or " at 0x" in name:
            return None
        return CACHE / f"{self._py_func.__name__}-{hashlib.sha256(name.encode()).hexdigest()[:32]}.code"


@functools.cache
def _import_array_functions() -> None:
    """Cached code needs this module of Numba, which imports scipy for 0.4 s only to know whether it is installed."""

    def has_scipy() -> None:
        if importlib.util.find_spec("scipy") is None:
            raise ImportError

    loaded, linalg.ensure_blas = linalg.ensure_blas, has_scipy
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = loaded


@functools.cache
def _source_digest(file: str) -> str:
    """Of a file with compiled functions and all that it imports; empty if it cannot be read, as in a notebook."""
    try:
        digests = [_file_digest(path) for path in sources(Path(file))]
    except OSError:
        return ""
    return hashlib.sha256("".join(digests).encode()).hexdigest()


@functools.cache
def _file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


reported: list[str] = []
"""What was logged: one line at most."""


def _warn(text: str) -> None:
    if not reported:
        reported.append(text)
        log.warning("%s", text)
