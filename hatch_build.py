"""Build hook of hatchling: builds the page before it is packed into a wheel or a source distribution."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PageBuildHook(BuildHookInterface):
    """Runs `scripts/page`, which builds the page if it is missing or older than its sources."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the files are collected. An editable install builds no page; `scripts/run` does."""
        if version == "editable":
            return
        page = Path(self.root, "scripts/page")
        if subprocess.run(["sh", str(page)], check=False).returncode:
            raise SystemExit("the page could not be built; see the message above")
