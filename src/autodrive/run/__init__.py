"""One run of the simulator: options, worlds, page server and devkit bridge, summary.

    from autodrive.run import RunOptions, simulate

    summary = simulate(RunOptions("mini_map", duration=5.0, speed=None, has_page=False))
    print(summary.real_time_factor)

Names are imported when they are first used, so that `import autodrive.run` is light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from autodrive.run.options import RunOptions as RunOptions
    from autodrive.run.runner import Run as Run
    from autodrive.run.runner import RunObserver as RunObserver
    from autodrive.run.runner import StopRequest as StopRequest
    from autodrive.run.runner import simulate as simulate
    from autodrive.run.summary import Summary as Summary

_MODULE_OF = {
    "RunOptions": "options",
    "Run": "runner",
    "RunObserver": "runner",
    "StopRequest": "runner",
    "simulate": "runner",
    "Summary": "summary",
}

__all__ = ["Run", "RunObserver", "RunOptions", "StopRequest", "Summary", "simulate"]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'autodrive.run' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"autodrive.run.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value
