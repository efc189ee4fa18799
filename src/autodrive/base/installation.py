"""The Python environment: its pip command, and a check for a mixed or incomplete installation of MuJoCo."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from autodrive.base.cache import PACKAGE

DISTRIBUTION = "autodrive-simulator"
MUJOCO = "mujoco-core>=4.0.0,<5"
"""The requirement in pyproject.toml."""


def version_of(distribution: str) -> str | None:
    """Installed version of a distribution, or None."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None


def mujoco_error() -> str:
    """What is wrong with the installed MuJoCo; empty if nothing is known to be wrong. Does not import it.

    The distributions `mujoco` 3.x and `mujoco-core` 4.x both contain the import package `mujoco`, and pip installs one
    over the other. The result either cannot be imported or mixes two versions of the library.
    """
    core, full = version_of("mujoco-core"), version_of("mujoco")
    if core is None:
        return "" if full is None else f"mujoco {full} is installed, but the simulator needs {MUJOCO}"
    if full not in {None, core}:
        return f"mujoco {full} and mujoco-core {core} are both installed, and one has overwritten files of the other"
    spec = importlib.util.find_spec("mujoco")
    if spec is None or spec.origin is None:
        return f"files of mujoco-core {core} are missing"
    names = [path.name for path in Path(spec.origin).parent.glob("libmujoco*")]
    versions = {match[0] for name in names if (match := re.search(r"\d+\.\d+\.\d+", name))}
    if versions and core not in versions:
        return f"mujoco-core {core} is installed, but its files are of version {', '.join(sorted(versions))}"
    return ""


def mujoco_fix() -> str:
    """The command that replaces every installed MuJoCo by the one that the simulator needs."""
    installed = " ".join(name for name in ("mujoco", "mujoco-core") if version_of(name))
    install = f"{pip('install')} '{MUJOCO}'"
    return f"{pip('uninstall')} {installed} && {install}" if installed else install


def pip(action: str) -> str:
    """Start of the command that installs or uninstalls packages in this environment, with pip or else uv."""
    if importlib.util.find_spec("pip") is not None:
        return f"{sys.executable} -m pip {action}{' -y' if action == 'uninstall' else ''}"
    uv = shutil.which("uv")
    root = checkout()
    if uv is None and root is not None and (root / ".venv-uv/bin/uv").is_file():
        uv = str(root / ".venv-uv/bin/uv")
    return f"{uv or 'uv'} pip {action} --python {sys.executable}"


def install_extra(extra: str) -> str:
    """The command that adds an extra to this installation: from where the package came, as pip noted it (PEP 610)."""
    return f"{pip('install')} {shlex.join(_requirement(extra, _origin()))}"


def missing(package: str, extra: str) -> str:
    """The error of a package that is not installed."""
    return f"{package} is not installed: it is in the extra '{extra}'. Install it:  {install_extra(extra)}"


def _requirement(extra: str, origin: dict[str, Any]) -> list[str]:
    """Arguments of pip: a folder, editable or not, the address of a repository or archive, or the release."""
    url = origin.get("url", "")
    if "dir_info" in origin:
        folder = unquote(urlsplit(url).path)
        return [*(["--editable"] if origin["dir_info"].get("editable") else []), f"{folder}[{extra}]"]
    if "vcs_info" in origin:
        url = f"{origin['vcs_info']['vcs']}+{url}@{origin['vcs_info']['commit_id']}"
    return [f"{DISTRIBUTION}[{extra}]" + (f" @ {url}" if url else "")]


def _origin() -> dict[str, Any]:
    """Content of the file direct_url.json of this distribution; empty for a release from an index."""
    try:
        text = importlib.metadata.distribution(DISTRIBUTION).read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        text = None
    root = checkout()
    return json.loads(text) if text else {"url": root.as_uri(), "dir_info": {"editable": True}} if root else {}


def checkout() -> Path | None:
    """Root folder of the repository if the package runs from a checkout."""
    root = PACKAGE.parents[1]
    return root if (root / "uv.lock").is_file() else None
