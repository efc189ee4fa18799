"""The C++ package, built with sanitizers."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.bridge.conftest import ROOT

PACKAGE = ROOT / "clients" / "cpp"
BUILD = ROOT / "build" / "cpp"
"""Kept, so that the next time only what has changed is compiled."""
HEADERS = ("boost/beast.hpp", "nlohmann/json.hpp", "eigen3/Eigen/Core")
LIMIT = 600.0
"""Wall time of a build [s]; the machine may be busy."""


@pytest.fixture(scope="session")
def build() -> Path:
    missing = [header for header in HEADERS if not Path("/usr/include", header).exists()]
    missing += [program for program in ("cmake", "g++") if shutil.which(program) is None]
    if missing:
        pytest.skip(f"no {', '.join(missing)}: run scripts/cpp")
    options = ["-DAUTODRIVE_BUILD_TESTS=ON", "-DAUTODRIVE_SANITIZE=ON", f"-DCMAKE_INSTALL_PREFIX={BUILD / 'installed'}"]
    run("cmake", "-S", PACKAGE, "-B", BUILD, *options)
    run("cmake", "--build", BUILD, "--parallel", "2")
    return BUILD


def run(*words: object, given: str | None = None) -> str:
    command = [str(word) for word in words]
    done = subprocess.run(command, input=given, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@contextmanager
def program(path: Path, *arguments: object) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """And its port. Ends it by SIGTERM, which must end well: the sanitizers speak at the end."""
    command = [str(word) for word in (path, *arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process, int(process.stdout.readline().split()[-1])
        process.terminate()
        _, said = process.communicate(timeout=30)
        assert process.returncode == 0, said
