"""The licences of all dependencies in docs/dependencies.md; `python -m tests.support.licences` writes the page."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from tests.support.lockfile import PLATFORMS, PYTHONS, needed, packages

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

EXTRAS = {
    "gymnasium": ("envs", "MIT"),
    "cloudpickle": ("envs", "BSD-3-Clause"),
    "farama-notifications": ("envs", "MIT"),
    "pettingzoo": ("envs", "MIT"),
    "onnxruntime": ("onnx", "MIT"),
    "flatbuffers": ("onnx", "Apache-2.0"),
    "av": ("film", "BSD-3-Clause"),
    "apsw": ("export", "any-OSI"),
    "scipy": ("campaigns", "BSD-3-Clause"),
    "attrs": ("rerun", "MIT"),
    "lz4": ("export", "BSD-3-Clause"),
    "minari": ("export", "MIT"),
    "packaging": ("ray", "Apache-2.0 OR BSD-2-Clause"),
    "pillow": ("export", "MIT-CMU"),
    "psutil": ("rerun", "BSD-3-Clause"),
    "pyarrow": ("export", "Apache-2.0"),
    "ruamel-yaml": ("export", "MIT"),
    "rerun-sdk": ("rerun", "MIT OR Apache-2.0"),
    "rosbags": ("export", "Apache-2.0"),
    "certifi": ("ray", "MPL-2.0"),
    "charset-normalizer": ("ray", "MIT"),
    "filelock": ("ray", "MIT"),
    "idna": ("ray", "BSD-3-Clause"),
    "jsonschema": ("ray", "MIT"),
    "jsonschema-specifications": ("ray", "MIT"),
    "msgpack": ("ray", "Apache-2.0"),
    "ray": ("ray", "Apache-2.0"),
    "referencing": ("ray", "MIT"),
    "requests": ("ray", "Apache-2.0"),
    "rpds-py": ("ray", "MIT"),
    "urllib3": ("ray", "MIT"),
    "absl-py": ("learn", "Apache-2.0"),
    "equinox": ("learn", "Apache-2.0"),
    "jax": ("learn", "Apache-2.0"),
    "jaxlib": ("learn", "Apache-2.0"),
    "jaxtyping": ("learn", "MIT"),
    "ml-dtypes": ("learn", "Apache-2.0"),
    "opt-einsum": ("learn", "MIT"),
    "optax": ("learn", "Apache-2.0"),
    "wadler-lindig": ("learn", "Apache-2.0"),
    "alembic": ("search", "MIT"),
    "cmaes": ("search", "MIT"),
    "colorlog": ("search", "MIT"),
    "mako": ("search", "MIT"),
    "markupsafe": ("search", "BSD-3-Clause"),
    "optuna": ("search", "MIT"),
    "sqlalchemy": ("search", "MIT"),
    "tqdm": ("search", "MPL-2.0 AND MIT"),
}
"""Package -> the extra that installs it, and its licence. These packages are not installed with the simulator."""

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


def python_licences() -> Iterator[tuple[str, str]]:
    """Name and licence of each package that some platform needs and that is installed here, without the extras."""
    names = {
        package["name"]
        for platform in PLATFORMS
        for python in PYTHONS
        for package in needed(packages(), platform.environment(python))
    }
    for name in sorted(names - EXTRAS.keys()):
        try:
            yield name, licence(name)
        except PackageNotFoundError:
            continue


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
    text += "".join(f"| {name} | {extra} | {licence} |\n" for name, (extra, licence) in EXTRAS.items())
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
