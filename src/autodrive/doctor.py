"""What this machine has and lacks for the simulator, and the exact line that mends it."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from autodrive.protocol.ports import DEVKIT_PORT, PORT

DISTRIBUTION = "autodrive-simulator"

_IMPORT_NAMES = {"mujoco-core": "mujoco", "pyyaml": "yaml", "resvg-py": "resvg_py"}
"""Import name of a distribution, where the two differ."""


class Finding(NamedTuple):
    """One thing that was looked at; `mend` is the line to run if it is not well."""

    subject: str
    is_well: bool
    says: str
    mend: str = ""


def examine() -> Iterator[Finding]:
    """Everything, from the ground up."""
    yield _python()
    yield from _packages()
    yield _data()
    yield _cache()
    yield _opengl()
    yield _machine()
    yield _page()
    yield from _page_tools()
    yield _port()
    yield _browser()
    yield _devkit()


def _python() -> Finding:
    version = platform.python_version()
    is_well = (3, 11) <= sys.version_info < (3, 15)
    return Finding("Python", is_well, f"{version} ({sys.executable})", "" if is_well else _apt("python3 python3-venv"))


def _packages() -> Iterator[Finding]:
    try:
        requirements = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        mend = f"{_installer()} --editable {_checkout() or '.'}"
        yield Finding(DISTRIBUTION, False, "not installed, only found as files", mend)
        return
    for requirement in requirements:
        name = requirement.split(";")[0].split("[")[0].rstrip("0123456789.*,<>=!~ ")
        yield _package(name, requirement.split(";")[0].strip())


def _package(name: str, requirement: str) -> Finding:
    """A package counts as well only if it can be imported: a shared library may be missing."""
    module = _IMPORT_NAMES.get(name, name)
    mend = f"{_installer()} --force-reinstall '{requirement}'"
    try:
        importlib.import_module(module)
        return Finding(name, True, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, False, "not installed", mend.replace(" --force-reinstall", ""))
    except ModuleNotFoundError as error:
        if error.name == module:
            return Finding(name, False, "not installed", mend.replace(" --force-reinstall", ""))
        return Finding(name, False, str(error), mend)
    except (ImportError, OSError) as error:
        return Finding(name, False, str(error), mend)


def _data() -> Finding:
    folder = Path(__file__).parent / "data"
    found = {kind: len(list((folder / kind).glob("*.yaml"))) for kind in ("vehicles", "modules", "maps", "scenarios")}
    says = ", ".join(f"{count} {kind}" for kind, count in found.items())
    return Finding("descriptions", all(found.values()), says, f"{_installer()} --force-reinstall {DISTRIBUTION}")


def _cache() -> Finding:
    """Where compiled code is kept; without it every start compiles for half a minute."""
    try:
        from autodrive import jit  # it sets numba's folder

        folder = Path(jit.numba.config.CACHE_DIR)  # pyright: ignore
    except ImportError as error:
        return Finding("compiled code", False, f"numba cannot be used: {error}", "")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        mend = f"export NUMBA_CACHE_DIR={tempfile.gettempdir()}/autodrive-{os.getuid()}"
        return Finding("compiled code", False, f"{folder}: {error.strerror}; every start would compile anew", mend)
    is_warm = any(folder.rglob("*.nbi"))
    return Finding("compiled code", True, f"{folder} ({'ready' if is_warm else 'the first start will compile'})")


def _opengl() -> Finding:
    """Without it the simulator runs on, without pictures of the cameras."""
    try:
        from autodrive.render.gl import PACKAGES, GlUnavailable, is_software, probe
    except ImportError as error:
        return Finding("OpenGL", False, f"moderngl cannot be used: {error}; cameras are unavailable")
    try:
        renderer = probe()
    except GlUnavailable:
        return Finding("OpenGL", False, "none; cameras are unavailable, all else works", _apt(PACKAGES))
    where = "in software, on the processor" if is_software(renderer) else "on the graphics card"
    return Finding("OpenGL", True, f"{renderer}: cameras are drawn {where}")


def _machine() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding("machine", True, f"{platform.system()} {platform.machine()}, {cores} cores")


def _page() -> Finding:
    """Without it programs can connect, people see nothing."""
    index = Path(__file__).parent / "page" / "index.html"
    if index.is_file():
        return Finding("page", True, str(index.parent))
    checkout = _checkout()
    mend = f"{checkout}/scripts/page" if checkout else f"{_installer()} --force-reinstall {DISTRIBUTION}"
    return Finding("page", False, "not built; there is nothing to look at, all else works", mend)


def _page_tools() -> Iterator[Finding]:
    """Node builds the page; where there is none `scripts/page` fetches it."""
    if _checkout() is None:
        return
    node = shutil.which("node")
    says = _output(node, "--version") if node else ""
    yield Finding(
        "Node", True, f"{says} ({node})" if says else "none; scripts/page fetches it from PyPI when it builds"
    )


def _port() -> Finding:
    """Not a fault: the next free one is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", PORT))
        except OSError as error:
            says = f"port {PORT} is in use ({error.strerror}); the next free one is taken, or that of --port"
            return Finding("port", True, says)
    return Finding("port", True, f"{PORT} is free for the page")


def _browser() -> Finding:
    """Not a fault: it may be on another machine."""
    from autodrive.browser import has_screen

    names = ("firefox", "chromium", "google-chrome", "chromium-browser", "google-chrome-stable", "microsoft-edge")
    found = next((path for name in names if (path := shutil.which(name))), "")
    if has_screen():
        return Finding("browser", True, found or "that of the system")
    return Finding("browser", True, f"{found or 'none found'}; no screen here, so the link is printed, not opened")


def _devkit() -> Finding:
    """Not a fault either way: the script may be started later."""
    with socket.socket() as probe:
        probe.settimeout(0.5)
        is_there = probe.connect_ex(("127.0.0.1", DEVKIT_PORT)) == 0
    says = f"{'a' if is_there else 'no'} script listens on 127.0.0.1:{DEVKIT_PORT}{'' if is_there else ' now'}"
    return Finding("devkit", True, says)


def _output(*command: str) -> str:
    """The first line that a program says; empty if it cannot be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.partition("\n")[0].strip()


# -- lines that mend --------------------------------------------------------------------------------------------


def _installer() -> str:
    """The start of the line that installs into this very Python."""
    if importlib.util.find_spec("pip") is not None:
        return f"{sys.executable} -m pip install"
    uv = shutil.which("uv")
    checkout = _checkout()
    own = checkout / ".venv-uv/bin/uv" if checkout else None
    if uv is None and own is not None and own.is_file():
        uv = str(own)
    return f"{uv or 'uv'} pip install --python {sys.executable}"


def _checkout() -> Path | None:
    """The folder of the repository, if we run from one."""
    root = Path(__file__).parents[2]
    return root if (root / "uv.lock").is_file() else None


def _apt(packages: str) -> str:
    return f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install -y --no-install-recommends {packages}"
