"""The licences of all dependencies in docs/dependencies.md; `python -m tests.support.licences` writes the page."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from tests.support.lockfile import PLATFORMS, PROJECT, PYTHONS, needed, packages

ROOT = Path(__file__).parents[2]
DOCUMENT = ROOT / "docs" / "dependencies.md"

ALLOWED = {
    *("0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "MIT"),
    *("MIT OR Apache-2.0", "Apache-2.0 OR BSD-2-Clause", "MIT-CMU"),
    "any-OSI",  # of apsw: any licence that the Open Source Initiative has approved, such as MIT
    *("PSF-2.0", "Zlib"),
    "MPL-2.0",  # of tqdm and certifi: it covers changes of their own files, and none is changed
}
"""SPDX identifiers of licences that suit a project under BSD-2-Clause."""

SPDX = {
    "3-Clause BSD License": "BSD-3-Clause",  # protobuf
    "Apache 2.0": "Apache-2.0",  # ray
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",  # lz4; its LICENSE file has three clauses
    "BSD": "BSD-2-Clause",  # Numba; its LICENSE file has two clauses
    "ISC License": "ISC",
    "MIT License": "MIT",
}
"""Names of licences in older metadata."""

MIT_TEXT = "Permission is hereby granted, free of charge, to any person obtaining a"

HEAD = """# Dependencies

These packages are installed with the simulator or are part of the page. `python -m tests.support.licences` generates
the tables; a test compares them with the installed packages, and the licences with those that are compatible with
BSD-2-Clause. (On Windows, `colorama` is also needed: BSD-3-Clause.) `uv.lock` and `web/package-lock.json` contain the
versions.

"""


EXTRAS_HEAD = """## Extras

`pip install -e '.[EXTRA]'` adds these packages. The wheels of av also contain FFmpeg under
the LGPL, and x264 and x265 under the GPL; the simulator uses only the encoders SVT-AV1 and libvpx.

"""


def extra_of() -> dict[str, str]:
    """Package -> the extra that installs it, of packages that are not installed with the simulator."""
    (project,) = (package for package in packages() if package["name"] == PROJECT)
    extras = {package["name"]: extra for extra, group in project["optional-dependencies"].items() for package in group}
    known = {*_names(extras=False), "colorama"}  # on Windows the simulator needs it, too
    while needs := {
        dependency["name"]: extras[package["name"]]
        for package in packages()
        if package["name"] in extras
        for dependency in package.get("dependencies", [])
        if dependency["name"] not in extras.keys() | known
    }:
        extras |= needs
    return extras


def _names(*, extras: bool) -> set[str]:
    """Names of the packages that some platform needs."""
    return {
        package["name"]
        for platform in PLATFORMS
        for python in PYTHONS
        for package in needed(packages(), platform.environment(python), extras=extras)
    }


def python_licences(*, extras: bool = False) -> Iterator[tuple[str, str]]:
    """Name and licence of each package that is needed and installed here, without the extras or only of those."""
    for name in sorted(extra_of() if extras else _names(extras=False)):
        with contextlib.suppress(PackageNotFoundError):
            yield name, licence(name)


def page_licences() -> Iterator[tuple[str, str]]:
    """Name and licence of each package that the page contains."""
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "web" / "src").rglob("*.ts"))
    lock = json.loads((ROOT / "web" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for path, package in sorted(lock.items()):
        name = path.removeprefix("node_modules/")
        if re.search(rf"""from ['"]{re.escape(name)}['"/]""", sources) and name:
            yield name, package["license"]


def parts(licence: str) -> set[str]:
    """The identifiers that all apply."""
    return set(licence.split(" AND "))


def page() -> str:
    """The content of the document."""
    text = HEAD
    for title, rows in (("Python", python_licences()), ("The page", page_licences())):
        text += f"## {title}\n\n| package | licence |\n|---|---|\n"
        text += "".join(f"| {name} | {licence} |\n" for name, licence in rows) + "\n"
    text += EXTRAS_HEAD + "| package | extra | licence |\n|---|---|---|\n"
    extras = extra_of()
    text += "".join(f"| {name} | {extras[name]} | {licence} |\n" for name, licence in python_licences(extras=True))
    return text


def licence(name: str) -> str:
    """The licence of a package that is installed here."""
    package = distribution(name)
    data = package.metadata
    classifiers = [line.split(" :: ")[-1] for line in data.get_all("Classifier") or [] if line.startswith("License ::")]
    stated: list[str] = [str(data["License-Expression"] or ""), str(data["License"] or ""), *classifiers]
    for name in stated:
        known = SPDX.get(name, name)
        if name and parts(known) <= ALLOWED:
            return known
    files = [file for file in package.files or () if "LICENSE" in file.name.upper()]
    if any(MIT_TEXT in file.read_text() for file in files):
        return "MIT"
    return next((name for name in stated if name), "unknown")


if __name__ == "__main__":
    DOCUMENT.write_text(page(), encoding="utf-8")
