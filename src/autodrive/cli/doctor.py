"""The command `doctor`: checks the installation and prints the command that fixes each problem."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import platform
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import typer

from autodrive.base.cache import PACKAGE
from autodrive.base.child_process import cpu_count
from autodrive.base.installation import DISTRIBUTION, checkout, mujoco_error, mujoco_fix, pip, version_of
from autodrive.protocol.ports import DEVKIT_PORT, PORT

CLIENT = "autodrive-client"
"""A part of `DISTRIBUTION`, for environments without a simulator."""

_IMPORT_NAMES = {
    "backports-zstd": "backports.zstd",
    "lazy-loader": "lazy_loader",
    "mujoco-core": "mujoco",
    "protobuf": "google.protobuf",
    "pyyaml": "yaml",
    "resvg-py": "resvg_py",
}
"""Import names of distributions, where the two names differ."""


def doctor() -> None:
    """Check the installation; print the command that fixes each problem."""
    failures = 0
    for check in run_checks():
        typer.echo(f"{'ok  ' if check.is_ok else 'FAIL'} {check.subject:<14} {check.text}")
        if not check.is_ok:
            failures += 1
            typer.echo(f"     fix:  {check.fix}" if check.fix else "")
    typer.echo("All checks passed." if not failures else f"{failures} failed.")
    raise typer.Exit(1 if failures else 0)


class Check(NamedTuple):
    """Result of one check; `fix` is the shell command that fixes a failure, empty if there is none."""

    subject: str
    is_ok: bool
    text: str
    fix: str = ""


def run_checks() -> Iterator[Check]:
    """All checks, in the order of the output."""
    yield _python()
    yield from packages()
    yield _data()
    yield _cache()
    yield _opengl()
    yield _machine()
    yield _page()
    yield from _page_tools()
    yield _port()
    yield _browser()
    yield _devkit()


def _python() -> Check:
    version = platform.python_version()
    is_ok = (3, 11) <= sys.version_info < (3, 15)
    return Check("Python", is_ok, f"{version} ({sys.executable})", "" if is_ok else _apt("python3 python3-venv"))


def packages() -> Iterator[Check]:
    """The packages that are required on this platform."""
    try:
        requirements = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        fix = f"{pip('install')} --editable {checkout() or '.'}"
        yield Check(DISTRIBUTION, False, "not installed; running from source files", fix)
        return
    if version_of(CLIENT):
        text = f"{CLIENT} contains a part of the files of {DISTRIBUTION}; install only one of them"
        fix = f"{pip('uninstall')} {CLIENT} && {pip('install')} --force-reinstall --no-deps {_own_requirement()}"
        yield Check(CLIENT, False, text, fix)
    for line in requirements:
        requirement, _, marker = (part.strip() for part in line.partition(";"))
        if not marker or _applies(marker):
            yield package(re.split(r"[\[<>=!~ ]", requirement)[0], requirement)


def _applies(marker: str) -> bool:
    """Whether an environment marker of pyproject.toml is true here."""
    values = {"sys_platform": sys.platform, "platform_machine": platform.machine(), "extra": ""}
    values["python_version"] = ".".join(platform.python_version_tuple()[:2])  # 3.11 to 3.14: texts compare as numbers
    return bool(eval(marker, {"__builtins__": {}}, values))  # markers of this form are Python expressions


def _own_requirement() -> str:
    """What pip installs again: the checkout, or the release."""
    root = checkout()
    return f"--editable {root}" if root else f"{DISTRIBUTION}=={version_of(DISTRIBUTION)}"


def package(name: str, requirement: str) -> Check:
    """Import the package: a shared library that it needs may be missing."""
    if name == "mujoco-core" and (error := mujoco_error()):
        return Check(name, False, error, mujoco_fix())
    module = _IMPORT_NAMES.get(name, name)
    fix = f"{pip('install')} --force-reinstall '{requirement}'"
    try:
        importlib.import_module(module)
        return Check(name, True, importlib.metadata.version(name))
    except (ImportError, OSError) as error:
        if isinstance(error, importlib.metadata.PackageNotFoundError) or getattr(error, "name", "") == module:
            return Check(name, False, "not installed", fix.replace(" --force-reinstall", ""))
        return Check(name, False, str(error), fix)


def _data() -> Check:
    folder = PACKAGE / "scenario" / "data"
    counts = {kind: len(list((folder / kind).glob("*.yaml"))) for kind in ("vehicles", "modules", "maps", "scenarios")}
    text = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    return Check("spec files", all(counts.values()), text, f"{pip('install')} --force-reinstall {DISTRIBUTION}")


def _cache() -> Check:
    """Cache of compiled code; without it every start compiles."""
    try:
        from autodrive.base import jit

        folder = jit.CACHE
    except ImportError as error:
        return Check("compiled code", False, f"Numba cannot be imported: {error}", "")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        setting = "set" if sys.platform == "win32" else "export"
        user = f"-{os.getuid()}" if hasattr(os, "getuid") else ""
        fix = f"{setting} NUMBA_CACHE_DIR={Path(tempfile.gettempdir()) / f'autodrive{user}'}"
        return Check(
            "compiled code", False, f"{folder}: {error.strerror}; every start would compile the code again", fix
        )
    return Check("compiled code", True, f"{folder} ({_state_of_cache(folder)})")


def _state_of_cache(folder: Path) -> str:
    """Whether there is compiled code for the next start."""
    from autodrive.base import jit

    if any(folder.glob("*.code")):
        return "ready"
    if not jit.SHIPPED.is_dir():
        return "empty: the first start compiles"
    built_for = (jit.SHIPPED / jit.VERSIONS).read_text(encoding="utf-8")
    if built_for != jit.versions():
        return f"empty: the first start compiles, because the code of the wheel is for other versions: {built_for}"
    return "empty: the code of the wheel is used" if jit.runs_baseline() else "empty: the first start compiles"


def _opengl() -> Check:
    """Optional: without OpenGL the simulator runs without camera images."""
    from autodrive.graphics.render.gl import BUILD_MODERNGL, PACKAGES, GlUnavailable, is_software, moderngl, probe

    if moderngl is None:
        return Check("OpenGL", False, "moderngl cannot be imported; cameras are unavailable", BUILD_MODERNGL)
    try:
        renderer = probe()
    except GlUnavailable:
        return Check("OpenGL", False, "not available; cameras are unavailable, everything else works", _apt(PACKAGES))
    device = "in software on the CPU" if is_software(renderer) else "on the GPU"
    return Check("OpenGL", True, f"{renderer}: cameras are rendered {device}")


def _machine() -> Check:
    return Check("machine", True, f"{platform.system()} {platform.machine()}, {cpu_count()} cores")


def _page() -> Check:
    """Check whether the page is installed, without which only programs can connect."""
    index = PACKAGE / "page" / "index.html"
    if index.is_file():
        return Check("page", True, str(index.parent))
    root = checkout()
    fix = f"{root}/scripts/page" if root else f"{pip('install')} --force-reinstall {DISTRIBUTION}"
    return Check("page", False, "not built; only programs can connect", fix)


def _page_tools() -> Iterator[Check]:
    """Node builds the page; `scripts/page` downloads Node if it is missing."""
    if checkout() is None:
        return
    node = shutil.which("node")
    text = _output(node, "--version") if node else ""
    yield Check("Node", True, f"{text} ({node})" if text else "not found; scripts/page downloads it from PyPI")


def _port() -> Check:
    """Never a failure: `autodrive run` uses the next free port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", PORT))
        except OSError as error:
            text = f"port {PORT} is in use ({error.strerror}); run uses the next free port, or the port of --port"
            return Check("port", True, text)
    return Check("port", True, f"{PORT} is free")


def _browser() -> Check:
    """Never a failure: the browser may run on another machine."""
    from autodrive.run.browser import has_screen

    names = ("firefox", "chromium", "google-chrome", "chromium-browser", "google-chrome-stable", "microsoft-edge")
    browser = next((path for name in names if (path := shutil.which(name))), "")
    if has_screen():
        return Check("browser", True, browser or "system default")
    return Check("browser", True, f"{browser or 'none found'}; no display: run prints the link instead of opening it")


def _devkit() -> Check:
    """Never a failure: the script may start later."""
    with socket.socket() as probe:
        probe.settimeout(0.5)
        is_listening = probe.connect_ex(("127.0.0.1", DEVKIT_PORT)) == 0
    text = f"{'a' if is_listening else 'no'} script listens on 127.0.0.1:{DEVKIT_PORT}{'' if is_listening else ' now'}"
    return Check("devkit", True, text)


def _output(*command: str) -> str:
    """First line of the output of a program; empty if it cannot run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.partition("\n")[0].strip()


# -- commands that fix a problem --------------------------------------------------------------------------------


def _apt(packages: str) -> str:
    """Empty where there is no apt."""
    if shutil.which("apt-get") is None:
        return ""
    return f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install -y --no-install-recommends {packages}"
