"""Compilation of a function in a process of its own, beside this one: Numba compiles on one core only."""

from __future__ import annotations

import contextlib
import importlib
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from autodrive.base import jit
from autodrive.base.child_process import cpu_count, start_module


def compile_ahead(function: Callable[..., object], *arguments: Any) -> None:
    """Start a process that compiles the function for arguments of these types, unless the cache has the code.

    `jit.resolved` waits for the process and loads its code from the cache; if the process failed, it compiles. Nothing
    is started where the cache cannot be written, because the code could not be passed on.
    """
    dispatcher: Any = function
    signature = jit.signature_of(arguments)
    is_known = (dispatcher, signature) in jit.awaited or not jit.must_compile(dispatcher, signature)
    if cpu_count() == 1 or is_known or not jit.can_save():
        return
    process = start_module(__name__)
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):  # it did not start
        pickle.dump((dispatcher.py_func.__module__, dispatcher.py_func.__name__, signature), process.stdin)
        process.stdin.flush()
    threading.Thread(target=_show, args=(process,), daemon=True).start()
    jit.awaited[dispatcher, signature] = process.wait


def main() -> None:
    """Compile a function in the child process, and print the name of each one that is compiled for it."""
    module, name, signature = pickle.load(sys.stdin.buffer)
    with jit.compiling(lambda function: print(function, flush=True)):
        getattr(importlib.import_module(module), name).compile(signature)


def _show(process: subprocess.Popen[bytes]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        jit.show(line.decode().strip())
