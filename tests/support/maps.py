"""Files of maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml


def map_file(folder: Path, **contents: Any) -> str:
    """Path of a map on which a car can be anywhere."""
    path = folder / "contacts.yaml"
    tree = {"title": "Contacts", "is_draft": True, "ground": {"length": 60.0, "width": 60.0}, **contents}
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(path)
