"""Has the page built before it is packed; hatchling calls this for a wheel and a source distribution."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PageBuildHook(BuildHookInterface):
    """Runs `scripts/page`, which does nothing where the page is built and as new as its sources."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the files are collected. An editable install builds nothing: `scripts/run` does."""
        if version == "editable":
            return
        page = Path(self.root, "scripts/page")
        if subprocess.run(["sh", str(page)], check=False).returncode:
            raise SystemExit("the page could not be built; what is missing is said above")
