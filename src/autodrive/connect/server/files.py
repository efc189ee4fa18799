"""The files that a browser may read, in memory: those of the built page and of the scene."""

from __future__ import annotations

import gzip
import mimetypes
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from autodrive.base.cache import PACKAGE

IMMUTABLE = "public, max-age=31536000, immutable"
REVALIDATE = "no-cache"

TYPES = {".js": "text/javascript", ".glb": "model/gltf-binary", ".woff2": "font/woff2", ".svg": "image/svg+xml"}
COMPRESSIBLE = {".html", ".js", ".css", ".svg", ".json", ".glb", ".txt", ".map", ".wasm"}
"""Endings of files that are compressed; images and fonts already are."""


def built_page() -> Path | None:
    """Folder of the page; None if it has not been built."""
    page = PACKAGE / "page"
    return page if (page / "index.html").is_file() else None


@dataclass(frozen=True)
class ServedFile:
    """A file; `is_immutable`: its content never changes, so that a browser may cache it for ever."""

    name: str
    content: bytes
    is_immutable: bool

    @property
    def headers(self) -> list[tuple[bytes, bytes]]:
        """The HTTP headers content-type and cache-control."""
        type_ = TYPES.get(_ending(self.name)) or mimetypes.guess_type(self.name)[0] or "application/octet-stream"
        if type_.startswith("text/"):
            type_ += "; charset=utf-8"
        cache = IMMUTABLE if self.is_immutable else REVALIDATE
        return [(b"content-type", type_.encode()), (b"cache-control", cache.encode())]

    @cached_property
    def compressed(self) -> bytes | None:
        """The content compressed with gzip; None if that saves less than 10 %."""
        if _ending(self.name) not in COMPRESSIBLE:
            return None
        compressed = gzip.compress(self.content, 6, mtime=0)
        return compressed if len(compressed) < 0.9 * len(self.content) else None


def page_files(folder: Path) -> dict[str, ServedFile]:
    """All files of the built page, by path. Names under assets/ hold a hash of the content."""
    files = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            name = path.relative_to(folder).as_posix()
            files[name] = ServedFile(name, path.read_bytes(), is_immutable=name.startswith("assets/"))
    return files


def immutable_files(contents: dict[str, bytes], folder: str) -> dict[str, ServedFile]:
    """Files in `folder` whose names hold a hash of their content."""
    return {f"{folder}/{name}": ServedFile(name, content, is_immutable=True) for name, content in contents.items()}


def _ending(name: str) -> str:
    return Path(name).suffix.lower()
