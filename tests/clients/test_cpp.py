"""The C++ package is built as its README says, and its examples drive the simulator."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from tests.bridge.viewers import scenery

PACKAGE = Path(__file__).parents[2] / "clients" / "cpp"
HEADERS = ("boost/beast.hpp", "nlohmann/json.hpp", "eigen3/Eigen/Core")
LIMIT = 300.0
"""Wall time of a build [s]; the machine may be busy."""


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    missing = [header for header in HEADERS if not Path("/usr/include", header).exists()]
    missing += [program for program in ("cmake", "g++") if shutil.which(program) is None]
    if missing:
        pytest.skip(f"no {', '.join(missing)}: apt-get install g++ cmake libboost-dev nlohmann-json3-dev libeigen3-dev")
    folder = tmp_path_factory.mktemp("cpp")
    options = ["-DCMAKE_BUILD_TYPE=Debug", "-DAUTODRIVE_BUILD_TESTS=ON", "-DAUTODRIVE_SANITIZE=ON"]
    run("cmake", "-S", PACKAGE, "-B", folder, f"-DCMAKE_INSTALL_PREFIX={folder / 'installed'}", *options)
    run("cmake", "--build", folder, "--parallel", "2")
    return folder


def run(*words: object) -> str:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@contextmanager
def program(path: Path, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Ends it by SIGTERM, which must end well: the sanitizers speak at the end."""
    command = [str(word) for word in (path, *arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        yield process
        process.terminate()
        _, said = process.communicate(timeout=30)
        assert process.returncode == 0, said


def test_its_own_tests_pass(build: Path) -> None:
    run("ctest", "--test-dir", build, "--output-on-failure")


def test_a_project_of_a_users_own_finds_the_package(build: Path, tmp_path: Path) -> None:
    run("cmake", "--install", build)
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(mine CXX)\nfind_package(autodrive 0.1 REQUIRED)\n"
        "add_executable(mine mine.cpp)\ntarget_link_libraries(mine PRIVATE autodrive::autodrive)\n"
    )
    (tmp_path / "mine.cpp").write_text(
        "#include <autodrive/text.hpp>\n#include <iostream>\n"
        'int main() { std::cout << autodrive::text::numbers("1 2.5").at(1); }\n'
    )
    run("cmake", "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={build / 'installed'}")
    run("cmake", "--build", tmp_path / "build")
    assert run(tmp_path / "build" / "mine") == "2.5"


def test_the_devkit_example_stops_before_the_box(build: Path) -> None:
    simulation = Simulation(autodrive.make("boxes"))
    with program(build / "stop_before_box", 0) as script:
        assert script.stdout is not None
        port = int(script.stdout.readline().split()[-1])
        with DevkitBridge(simulation, port=port) as bridge:
            simulation.run(6.0)
            assert bridge.counters.refused_values == 0
            assert bridge.counters.commands_received > 100
    car = simulation.frame.vehicles["V1"]
    assert abs(car.speed) < 1e-3
    assert 0.3 < car.pose.position[0] < 0.5
    assert car.lights.headlights == 1
    assert car.collision_count == 0


def test_lock_step_in_cpp_gives_the_bits_of_world_step(build: Path) -> None:
    simulation = Simulation(autodrive.make("mini_map"))
    with simulation, Server(simulation, scenery=scenery, port=0) as server:
        said = run(build / "lockstep", server.port).split()
    world = autodrive.make("mini_map")
    while world.time < 2.0:
        frame = world.step({"V1": Command(0.5, 0.2)})
    car = frame.vehicles["V1"]
    assert car.lidar is not None
    assert int(said[0]) == frame.tick
    np.testing.assert_array_equal([float(word) for word in said[1:4]], car.pose.position)
    assert (float(said[4]), float(said[5])) == (car.speed, car.lidar.ranges[0])
