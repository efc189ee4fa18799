"""The versions and the machine of a recording."""

from __future__ import annotations

import importlib.metadata
import platform
import sys

from autodrive.base.version import __version__


def about_here() -> dict[str, str]:
    """Versions of this installation, and its platform, by name."""
    return {
        "version": __version__,
        "engine": f"mujoco {_version_of('mujoco-core')}",
        "numpy": _version_of("numpy"),
        "python": platform.python_version(),
        "platform": f"{sys.platform} {platform.machine()}",
    }


def _version_of(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
