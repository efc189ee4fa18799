"""Classes and functions in Python files of the user, which scenarios and campaigns name: 'my_radar.py:Radar'."""

from __future__ import annotations

import functools
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from autodrive.base.readable import readable

FUNCTION = re.compile(r"(?P<file>[^\s:]+\.py):(?P<name>[A-Za-z_]\w*)")
"""A class or function of the user: 'my_driver.py:Driver'."""


def load(file: Path, name: str) -> Any:
    """A class or function in a Python file; modules beside the file can be imported.

    Raises `ImportError` if the file does not have it, `OSError` if it cannot be read, and whatever the file raises.
    """
    module = _module(file.absolute(), readable(file).stat().st_mtime_ns)
    if not hasattr(module, name):
        raise ImportError(f"{file.name} has no '{name}'")
    return getattr(module, name)


@functools.cache
def _module(file: Path, _changed: int) -> ModuleType:
    """The file as it was changed last."""
    folder = str(file.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    spec = importlib.util.spec_from_file_location(f"own_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look for it there
    spec.loader.exec_module(module)
    return module
