"""Hooks of hatchling: one builds the page before it is packed, one makes the links of README.md work on PyPI.

With `AUTODRIVE_COMPILED`, a folder that `autodrive.cli.compiled` has filled, the wheel has that code, too. It is for
the Python that builds it, on Linux and x86-64; the version of Linux is that of the wheels of Numba.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

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


class ReadmeHook(MetadataHookInterface):
    """Sets the description for PyPI: README.md, with links to the repository if `project.urls` has its address."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `readme`."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        if address := metadata.get("urls", {}).get("Repository"):
            text = with_address(text, address.rstrip("/"), metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def with_address(text: str, address: str, version: str) -> str:
    """The text with absolute links: files as the tag of this version has them, pictures as files without a page."""
    relative = r"(?!https?:|#)([^)\s\"]+)"
    raw, page = f"{address}/raw/v{version}", f"{address}/blob/v{version}"
    text = re.sub(rf"(!\[[^\]]*\]\(){relative}\)", rf"\g<1>{raw}/\g<2>)", text)
    text = re.sub(rf"(<(?:img|video|source)\b[^>]* src=\"){relative}\"", rf'\g<1>{raw}/\g<2>"', text)
    return re.sub(rf"(\]\(){relative}\)", rf"\g<1>{page}/\g<2>)", text)
