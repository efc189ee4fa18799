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
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core import config, event, types
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.np import linalg

from autodrive.base.cache import PACKAGE, cache_folder, read_cached, sources, write_cached
from autodrive.base.turns import Turns

Function = TypeVar("Function", bound=Callable[..., object])

log = logging.getLogger(__name__)

DURATION = "10 s on a fast machine, two minutes on a slow one"
"""How long the first start compiles."""


def _folder() -> Path:
    """A folder for each version of the compiler; see `_FileCache` for versions of the functions."""
    own = cache_folder("numba", also=f"{numba.__version__} {llvmlite.__version__}")
    return Path(os.environ["NUMBA_CACHE_DIR"], own.name) if os.environ.get("NUMBA_CACHE_DIR") else own


CACHE = _folder()
"""Folder of compiled functions: `NUMBA_CACHE_DIR`, or the user's cache folder."""
SHIPPED = PACKAGE / "compiled"
"""Compiled functions that were installed with this package: only the wheels for x86-64 have them, see scripts/release.
They are used for what is not in `CACHE`."""
VERSIONS = "versions"
"""Name of the file in `SHIPPED` that says to people for which `versions` the functions were compiled."""
BASELINE = "x86-64-v3", ""
"""`NUMBA_CPU_NAME` and `NUMBA_CPU_FEATURES` with which they were compiled: code for any processor that has these:"""
BASELINE_NEEDS = (
    *("sse3", "ssse3", "sse4.1", "sse4.2", "popcnt", "cx16", "sahf"),  # x86-64-v2
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
"""Features of x86-64-v3 by their names in LLVM (System V ABI, AMD64 supplement, 3.1.1)."""


def jit(function: Function) -> Function:
    """Compile at the first call or load from the cache. Same bits in every run: no fast math, no threads."""
    return _compiled(function)


def inlined(function: Function) -> Function:
    """Compile as `jit` does, for inner loops: LLVM copies the code into the callers, and does not count references.

    Passing a whole Model and State, and counting references to their arrays, would cost more than the function
    itself. Such a function, and a `jit_uncounted` function that calls it, cannot create arrays.
    """
    return _compiled(function, forceinline=True, _nrt=False)


def inlined_part(function: Function) -> Function:
    """Compile as `inlined` does, for a function that is made in another one: only its callers are in the cache.

    Only compiled code calls it.
    """
    options: Any = {**_OPTIONS, **_PART, "forceinline": True, "_nrt": False}
    return numba.njit(function, **options)  # pyright: ignore


def jit_uncounted(function: Function) -> Function:
    """Compile as `jit` does, without reference counting: for the outermost function that calls `inlined` functions."""
    return _compiled(function, _nrt=False)


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
    files = [path for path, _ in dispatcher._cache.files(signature, dispatcher.targetctx.codegen())]
    return bool(files) and not any(path.exists() for path in files)


@functools.cache
def runs_baseline() -> bool:
    """Whether this processor can run code for `BASELINE`."""
    try:
        return all(llvm.get_host_cpu_features().get(name) for name in BASELINE_NEEDS)
    except RuntimeError:  # the processor is not known
        return False


def show(function: str) -> None:
    """Call what `compiling` was given: a function is compiled."""
    for watcher in [*_watchers]:
        watcher(function)


def can_save() -> bool:
    """Whether the cache can be written."""
    try:
        CACHE.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(CACHE, os.W_OK)


@contextmanager
def compiling(progress: Callable[[str], None]) -> Iterator[None]:
    """Calls `progress` with the name of each function that is compiled inside the `with` block.

    Nothing is called if all functions are in the cache. The first run on a machine compiles.
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
            announcements.append(f"compiling the physics for this machine, once: this takes {DURATION}")
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


# -- compiled functions ---------------------------------------------------------------------------------------------

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True}
_PART: dict[str, Any] = {"no_cpython_wrapper": True}


class _Compiled(CPUDispatcher):
    """A function for Python and for compiled code, which calls `part`: the same function that Python cannot call.

    Most functions are called by compiled code only. What Python needs to call a function takes Numba longer than the
    function, because it takes a Model and a State apart.
    """

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None) -> None:
        options = dict(targetoptions)
        super().__init__(py_func, locals, options)
        self._cache = _FileCache(py_func, options)
        self.part = CPUDispatcher(py_func, locals, {**options, **_PART})
        self.part._cache = _FileCache(py_func, self.part.targetoptions)  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self.part)


def _compiled(function: Function, **options: Any) -> Function:
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return function
    compiled: Any = _Compiled(function, targetoptions={"nopython": True, **_OPTIONS, **options})
    return compiled


# -- the cache ------------------------------------------------------------------------------------------------------

turns = Turns()


class _FileCache(FunctionCache):
    """A checked file for each function and its argument types; without a usable file, the function is compiled.

    The file is valid for one version of the function's module and of all modules that it imports, because a function
    also contains those that it calls.

    Processes that need the same file at once take turns: one compiles, and the others load.

    Numba's own cache raises for a damaged file or a full disk, and its index can be wrong after two processes have
    written it at once.
    """

    def __init__(self, function: Callable[..., object], options: Mapping[str, Any]) -> None:
        self._py_func = function  # for `_index_key`
        self._key = f"{function.__module__}.{function.__qualname__} {sorted(options.items())} {versions()}"
        self._cache_path = str(CACHE)
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        rtsys.initialize(target_context)  # the rest of `refresh` serves compilations, which call it themselves
        _import_array_functions()
        compiled = self._loaded(sig, target_context)
        path, _ = next(self.files(sig, target_context.codegen()), (None, ""))
        if compiled is None and path is not None and turns.take(path):
            compiled = self._loaded(sig, target_context)
            if compiled is not None:
                turns.end(path)
        return compiled

    def _loaded(self, sig: Any, target_context: Any) -> CompileResult | None:
        for path, key in self.files(sig, target_context.codegen()):
            try:
                its_key, *content = pickle.loads(read_cached(path))
                if its_key != key:
                    raise ValueError(f"{path} has the name of another file")
                return CompileResult._rebuild(target_context, *content)
            except (FileNotFoundError, NotADirectoryError):
                continue
            except OSError as error:
                _warn(
                    f"the cache of compiled code cannot be read: {error.strerror}; the code is compiled again  ({path})"
                )
            except Exception:  # unpickling may raise anything
                _warn(f"the cache of compiled code is damaged; the damaged functions are compiled again  ({path})")
            return None  # the compiled code replaces that file
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        path, key = next(self.files(sig, data.codegen), (None, ""))
        if path is None:
            return
        try:
            if not data.lifted and not data.library.has_dynamic_globals:
                write_cached(path, dumps((key, *data._reduce())))
        except OSError as error:
            _warn(
                f"the cache of compiled code cannot be written: {error.strerror}; every start compiles the code "
                f"again, unless NUMBA_CACHE_DIR names another folder  ({CACHE})"
            )
        finally:
            turns.end(path)

    def flush(self) -> None:
        """Nothing: files of other sources have other names."""

    def files(self, sig: Any, codegen: Any) -> Iterator[tuple[Path, str]]:
        """Where code for these types may be, in the order of preference, and all that the code depends on.

        None if no name is certain, because the source cannot be read or a type is named by an address.
        """
        source = source_digest(inspect.getfile(self._py_func))
        types, target, code = self._index_key(sig, codegen)
        targets = [(CACHE, target)] + [(SHIPPED, (target[0], *BASELINE))] * (SHIPPED.is_dir() and runs_baseline())
        for folder, target in targets:
            key = f"{self._key} {source} {types} {target} {code}"
            if source and " at 0x" not in key:
                digest = hashlib.sha256(key.encode()).hexdigest()
                yield folder / f"{self._py_func.__name__}-{digest[:32]}.code", key


@functools.cache
def versions() -> str:
    """Versions of all that makes code from a source: the compiler, and what it takes from Python and numpy."""
    settings = [getattr(config, name) for name in ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK")]
    numpy = ".".join(np.__version__.split(".")[:2])
    packages = f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, numpy {numpy}"
    return f"{sys.implementation.cache_tag}, {packages}, settings {settings}"


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
def source_digest(file: str) -> str:
    """Digest of a file with compiled functions and all that it imports; empty if it cannot be read (a notebook)."""
    try:
        digests = [file_digest(path) for path in sources(Path(file))]
    except OSError:
        return ""
    return hashlib.sha256("".join(digests).encode()).hexdigest()


@functools.cache
def file_digest(path: Path) -> str:
    """Digest of the content of a file. Raises `OSError`."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


reported: list[str] = []
"""What was logged: one line at most."""


def _warn(text: str) -> None:
    if not reported:
        reported.append(text)
        log.warning("%s", text)
