"""The files that a browser may read: those of the built page and of the scenery, by name, from memory."""

from __future__ import annotations

import gzip
import mimetypes
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

IMMUTABLE = "public, max-age=31536000, immutable"
ASK_AGAIN = "no-cache"

TYPES = {".js": "text/javascript", ".glb": "model/gltf-binary", ".woff2": "font/woff2", ".svg": "image/svg+xml"}
PACKED = {".html", ".js", ".css", ".svg", ".json", ".glb", ".txt", ".map", ".wasm"}
"""Endings of what is worth to be compressed; pictures and fonts are already."""


@dataclass(frozen=True)
class File:
    """Content, what it is, and how long a browser may keep it."""

    name: str
    content: bytes
    is_immutable: bool

    @property
    def headers(self) -> list[tuple[bytes, bytes]]:
        """Type and cache."""
        type_ = TYPES.get(_ending(self.name)) or mimetypes.guess_type(self.name)[0] or "application/octet-stream"
        if type_.startswith("text/"):
            type_ += "; charset=utf-8"
        cache = IMMUTABLE if self.is_immutable else ASK_AGAIN
        return [(b"content-type", type_.encode()), (b"cache-control", cache.encode())]

    @cached_property
    def packed(self) -> bytes | None:
        """Compressed with gzip, where that pays."""
        if _ending(self.name) not in PACKED:
            return None
        packed = gzip.compress(self.content, 6, mtime=0)
        return packed if len(packed) < 0.9 * len(self.content) else None


def page_files(folder: Path) -> dict[str, File]:
    """Every file of the built page by its path; what the build named after its content never changes."""
    files = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            name = path.relative_to(folder).as_posix()
            files[name] = File(name, path.read_bytes(), is_immutable=name.startswith("assets/"))
    return files


def scene_files(contents: dict[str, bytes], folder: str) -> dict[str, File]:
    """The scenery's; their names hold a digest of their content."""
    return {f"{folder}/{name}": File(name, content, is_immutable=True) for name, content in contents.items()}


def _ending(name: str) -> str:
    return Path(name).suffix.lower()
