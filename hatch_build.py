"""Build hook of hatchling: builds the page before it is packed into a wheel or a source distribution.

With `AUTODRIVE_COMPILED`, a folder that `scripts/compiled` has filled, the wheel contains that code, too. It is for the
Python that builds it, on Linux and x86-64; the version of Linux is that of the wheels of Numba.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLATFORM = "manylinux_2_28_x86_64"


class PageBuildHook(BuildHookInterface):
    """Runs `scripts/page`, which builds the page if it is missing or older than its sources."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the files are collected. An editable install builds no page; `scripts/run` does."""
        if version == "editable":
            return
        page = Path(self.root, "scripts/page")
        if subprocess.run(["sh", str(page)], check=False).returncode:
            raise SystemExit("the page could not be built; see the message above")
        if compiled := os.environ.get("AUTODRIVE_COMPILED"):
            python = "cp{}{}".format(*sys.version_info)
            build_data["tag"] = f"{python}-{python}-{PLATFORM}"
            build_data["pure_python"] = False
            build_data["force_include"][compiled] = "autodrive/compiled"
