"""One build of the C++ package and of the programs of docs/cpp.md for all tests, with sanitizers."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.builds import build_once, run

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "clients" / "cpp"
PAGE = ROOT / "docs" / "cpp.md"
BUILD = ROOT / "build" / "cpp"
HEADERS = ("boost/beast.hpp", "nlohmann/json.hpp", "eigen3/Eigen/Core")


def cmake(source: Path, folder: Path, *options: str) -> None:
    """Configure and build, with Ninja and ccache if they are installed."""
    if shutil.which("ninja"):
        options = ("-GNinja", *options)
    if shutil.which("ccache"):
        options = (*options, "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    run("cmake", "-S", source, "-B", folder, "-DCMAKE_CXX_FLAGS=-O0", *options)
    run("cmake", "--build", folder, "--parallel", "2")


@pytest.fixture(scope="session")
def build() -> Path:
    """The build folder of the package."""
    missing = [header for header in HEADERS if not Path("/usr/include", header).exists()]
    missing += [program for program in ("cmake", "g++") if shutil.which(program) is None]
    if missing:
        pytest.skip(f"no {', '.join(missing)}: run scripts/cpp")
    folder = BUILD / "package"

    def build_package() -> None:
        installed = f"-DCMAKE_INSTALL_PREFIX={BUILD / 'installed'}"
        cmake(PACKAGE, folder, "-DAUTODRIVE_BUILD_TESTS=ON", "-DAUTODRIVE_SANITIZE=ON", installed)
        run("cmake", "--install", folder)

    build_once(folder, [PACKAGE], compiler(), build_package)
    return folder


@pytest.fixture(scope="session")
def programs(build: Path) -> Path:
    """The two programs of the page, built in a user's project that finds the installed package."""
    folder, text = BUILD / "page", PAGE.read_text()

    def build_programs() -> None:
        sources = re.findall(r"```cpp\n(#include.*?)```", text, re.DOTALL)
        (project,) = re.findall(r"```cmake\n(cmake_minimum_required.*?)```", text, re.DOTALL)
        for name, source in zip(("drive", "step"), sources, strict=True):
            (folder / f"{name}.cpp").write_text(source)
        # the header-only target is slow to compile, so only its syntax is checked
        (folder / "headers.cpp").write_text(
            "#include <autodrive/client.hpp>\n#include <autodrive/devkit.hpp>\n"
            "int main() { autodrive::devkit::Server().run(); autodrive::Client().next(); }\n"
        )
        (folder / "CMakeLists.txt").write_text(
            project
            + "add_executable(step step.cpp)\ntarget_link_libraries(step PRIVATE autodrive::compiled)\n"
            + "add_library(headers OBJECT headers.cpp)\ntarget_link_libraries(headers PRIVATE autodrive::autodrive)\n"
            + "target_compile_options(headers PRIVATE -fsyntax-only -Wall -Wextra)\n"
        )
        cmake(folder, folder / "build", f"-DCMAKE_PREFIX_PATH={BUILD / 'installed'}")

    build_once(folder, [PACKAGE, PAGE], compiler(), build_programs)
    return folder / "build"


def compiler() -> str:
    return run("g++", "--version")


@contextmanager
def program(path: Path, *arguments: object) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A running program and its port. It must end without an error at SIGTERM: the sanitizers report then."""
    command = [str(word) for word in (path, *arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process, int(process.stdout.readline().split()[-1])
        process.terminate()
        _, messages = process.communicate(timeout=120)
        assert process.returncode == 0, messages
