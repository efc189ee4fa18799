"""What a default install downloads on this machine, by the lock; more than 110 MB is a fault (exit code 1).

    uv run benchmarks/size.py

The lock names the wheels; their sizes are asked of the registry (no wheel is downloaded).
"""

from __future__ import annotations

import re
import sys
import tomllib
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from packaging.markers import Marker
from packaging.tags import sys_tags
from packaging.utils import parse_wheel_filename

LIMIT = 110.0
"""[MB], a million bytes each."""

PROJECT = "autodrive-simulator"

Package = dict[str, Any]


def main() -> None:
    lock = tomllib.loads((Path(__file__).parents[1] / "uv.lock").read_text(encoding="utf-8"))
    sizes = {package["name"]: megabytes(wheel_url(package)) for package in needed(lock["package"])}
    for name, size in sorted(sizes.items(), key=lambda item: -item[1]):
        print(f"{name:24s} {size:6.1f} MB")
    total = sum(sizes.values())
    print(f"{'all ' + str(len(sizes)) + ' packages':24s} {total:6.1f} MB, at most {LIMIT:.0f} MB")
    sys.exit(total > LIMIT)


def needed(packages: list[Package]) -> Iterator[Package]:
    """Every package that the project needs here, without the developers' tools and without itself."""
    to_visit = [package for package in packages if package["name"] == PROJECT]
    seen: set[str] = set()
    while to_visit:
        package = to_visit.pop()
        if package["name"] in seen:
            continue
        seen.add(package["name"])
        if package["name"] != PROJECT:
            yield package
        for dependency in package.get("dependencies", []):
            if Marker(dependency.get("marker", "python_version > '3'")).evaluate():
                to_visit.append(locked(packages, dependency))


def locked(packages: list[Package], dependency: Package) -> Package:
    """The package that a dependency names; where the lock holds several versions it names one."""
    (one,) = (
        package
        for package in packages
        if package["name"] == dependency["name"]
        and dependency.get("version", package.get("version")) == package.get("version")
    )
    return one


def wheel_url(package: Package) -> str:
    """The wheel that an installer takes here: the first of this Python's tags that a wheel has."""
    tags = {tag: rank for rank, tag in enumerate(sys_tags())}
    ranked = [
        (rank, wheel["url"])
        for wheel in package.get("wheels", [])
        if (rank := min(tags.get(tag, 1 << 30) for tag in wheel_tags(wheel["url"]))) < 1 << 30
    ]
    if not ranked:
        sys.exit(f"{package['name']} {package['version']} has no wheel for this machine")
    return min(ranked)[1]


def wheel_tags(url: str) -> Any:
    return parse_wheel_filename(re.sub("%2B", "+", url.rsplit("/", 1)[1]))[3]


def megabytes(url: str) -> float:
    request = urllib.request.Request(url, method="HEAD")
    with urllib.request.urlopen(request, timeout=60) as answer:
        return int(answer.headers["Content-Length"]) / 1e6


if __name__ == "__main__":
    main()
