"""Checks the files of a release: their sizes, and that only what belongs there is inside.

`python -m tests.support.released dist/*` prints what is wrong. Needs git, which lists the files of the repository.
"""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
SIZE_MAX = 100 * 1000**2
"""Size of a file that PyPI takes without a request [bytes]."""
MADE = ("PKG-INFO", "src/autodrive/page/")
"""Parts of a source distribution that are not in the repository."""
CLIENT = "clients/python/"
"""Folder whose files are the source distribution of autodrive-client, together with a part of the package."""


def main() -> None:
    """Check the files that the arguments name; the exit code is 1 if something is wrong."""
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    wrong = [problem for file in sys.argv[1:] for problem in problems(Path(file), set(tracked.stdout.splitlines()))]
    print(*wrong, sep="\n", end="\n" if wrong else "")
    raise SystemExit(1 if wrong else 0)


def problems(file: Path, tracked: set[str], *, size_max: int = SIZE_MAX) -> Iterator[str]:
    """What is wrong with a wheel or a source distribution; `tracked` are the files of the repository."""
    size = file.stat().st_size
    if size > size_max:
        yield f"{file.name} has {size / 1e6:.1f} MB; PyPI takes at most {size_max / 1e6:.1f} MB"
    if file.suffix == ".whl":
        with zipfile.ZipFile(file) as archive:
            names = [name for name in archive.namelist() if not name.endswith("/")]
        strange = [name for name in names if not _belongs_in_wheel(name)]
    else:
        with tarfile.open(file) as archive:
            names = [member.name.partition("/")[2] for member in archive if not member.isdir()]
        strange = [name for name in names if not _belongs_in_source(name, tracked)]
    if not names:
        yield f"{file.name} is empty"
    for name in strange:
        yield f"{file.name} contains {name}, which is not part of the distribution"


def _belongs_in_wheel(name: str) -> bool:
    top = name.partition("/")[0]
    return top == "autodrive" or top.endswith(".dist-info")


def _belongs_in_source(name: str, tracked: set[str]) -> bool:
    """A hidden file is a setting of tools, but `.gitignore` is of hatchling. A link to a folder is a file for git."""
    path = Path(name)
    if any(part.startswith(".") for part in path.parts):
        return name == ".gitignore"
    paths = {name, CLIENT + name, *map(str, path.parents)}
    return name.startswith(MADE) or not tracked.isdisjoint(paths)


if __name__ == "__main__":
    main()
