"""Size of the download of a default install on this machine, from uv.lock; exit code 1 above 112 MB.

    uv run benchmarks/size.py

The lock names the wheels. Their sizes are asked of the registry; no wheel is downloaded.
"""

from __future__ import annotations

import sys
import urllib.request
from pathlib import Path

from packaging.tags import sys_tags

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.support.lockfile import Package, needed, packages, wheels

LIMIT = 112.0
"""[MB], 10^6 bytes each."""


def main() -> None:
    sizes = {package["name"]: megabytes(wheel_url(package)) for package in needed(packages(), extras=False)}
    for name, size in sorted(sizes.items(), key=lambda item: -item[1]):
        print(f"{name:24s} {size:6.1f} MB")
    total = sum(sizes.values())
    print(f"{'all ' + str(len(sizes)) + ' packages':24s} {total:6.1f} MB, at most {LIMIT:.0f} MB")
    sys.exit(total > LIMIT)


def wheel_url(package: Package) -> str:
    """The wheel that an installer chooses here: the first tag of this Python for which there is a wheel."""
    ranks = {tag: rank for rank, tag in enumerate(sys_tags())}
    fitting = [
        (min(ranks[tag] for tag in tags if tag in ranks), url) for url, tags in wheels(package) if tags & ranks.keys()
    ]
    if not fitting:
        sys.exit(f"{package['name']} {package['version']} has no wheel for this machine")
    return min(fitting)[1]


def megabytes(url: str) -> float:
    request = urllib.request.Request(url, method="HEAD")
    with urllib.request.urlopen(request, timeout=60) as answer:
        return int(answer.headers["Content-Length"]) / 1e6


if __name__ == "__main__":
    main()
