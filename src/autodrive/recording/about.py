"""The versions and the machine of a recording."""

from __future__ import annotations

import importlib.metadata
import platform
import sys

from autodrive.base.jit import source_digest
from autodrive.base.version import __version__
from autodrive.world import tick


def about_here() -> dict[str, str]:
    """Versions of this installation, and its platform, by name; `code`: digest of the source of a tick."""
    return {
        "version": __version__,
        "code": source_digest(tick.__file__)[:12],
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
