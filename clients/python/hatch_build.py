"""Collects the files of autodrive-client from the simulator's source tree; hatchling runs these hooks."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface


def source(root: Path) -> Path:
    """The folder of the import package: in a checkout two levels up, in a source distribution below `root`."""
    own = root / "src/autodrive"
    return own if own.is_dir() else root.parents[1] / "src/autodrive"


class VersionHook(MetadataHookInterface):
    """Reads the version from the import package: client and simulator have the same version."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `version`."""
        text = (source(Path(self.root)) / "base" / "version.py").read_text(encoding="utf-8")
        found = re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE)
        if found is None:
            raise ValueError("src/autodrive/base/version.py has no line __version__")
        metadata["version"] = found[1]


class FilesHook(BuildHookInterface):
    """Adds the listed modules to a wheel or source distribution."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Fill `force_include`. An editable install needs no files."""
        if version == "editable":
            return
        root = Path(self.root)
        folder = "autodrive" if self.target_name == "wheel" else "src/autodrive"
        for name in tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["autodrive"][
            "modules"
        ]:
            path = source(root) / name
            for file in [path] if path.is_file() else sorted(path.rglob("*")):
                if file.is_file() and "__pycache__" not in file.parts:
                    build_data["force_include"][str(file)] = f"{folder}/{file.relative_to(source(root)).as_posix()}"
