"""Adapters: our vector environment in the form that a learning library expects. Each module needs its library."""

from __future__ import annotations

import importlib


def require(module: str, distribution: str) -> None:
    """Raises ImportError, with the command that installs the library, if it is not installed."""
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise ImportError(f"this adapter needs {module}; install it with:  pip install {distribution}") from None
