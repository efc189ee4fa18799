"""Model, State and Frames have the same bits on all processors.

The libraries choose code for the processor; their settings select the code of another one. Nothing calls them where
numbers become parameters, states or readings, except MuJoCo (see docs/determinism.md).
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features

import autodrive
from autodrive.base import jit
from autodrive.physics.model import model_digest
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.physics.tick import advance
from autodrive.protocol.messages import Command
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.cars import car_file
from tests.support.frames import bytes_of

ROOT = Path(__file__).parent.parent
TICKS = 300
LIMIT = 1200.0
"""Wall time of one process [s]: it may have to compile everything, on a busy machine."""
NOISY = {name: SensorSettings(noise="strong") for name in ("encoders", "ips", "imu", "lidar")}
IS_X86 = platform.machine() in {"x86_64", "AMD64"}
OLDER_C_LIBRARY = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2"}

SETTINGS: dict[str, dict[str, str]] = {
    "OpenBLAS for Prescott, the C library without FMA and AVX2, numpy without dispatched features": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": " ".join(np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])),
        **OLDER_C_LIBRARY,
    },
    "OpenBLAS for Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS for SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"},
}
"""The first one has all differences of the libraries at once."""
WHEEL = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
"""With the compiled code of a wheel: compiled for this processor, nothing would have these names."""


def slalom(folder: Path) -> World:
    """Two cars that touch nothing; the second has a rolling LIDAR, a tilted IMU and a range sensor."""
    second = car_file(
        folder,
        {
            "sensors.lidar.is_rolling": True,
            "sensors.imu.mount": {"position": [0.1, 0.02, 0.05], "rotation_deg": [3.0, -5.0, 17.0]},
            "sensors.range": {"mount": {"position": [0.2, 0.0, 0.1], "rotation_deg": [0.0, 0.0, 11.0]}},
        },
    )
    vehicles = {
        "V1": VehiclePlacement(x=-1.1, y=-0.15, sensors=NOISY),
        "V2": VehiclePlacement(x=0.5, y=-0.15, yaw_deg=3.0, type=second, has_realistic_sensors=True),
    }
    return autodrive.make(ScenarioSpec(map="tiny_town", vehicles=vehicles, seed=5))


def drive(tick: int) -> dict[str, Command]:
    """Full lock to both sides, at two speeds; no function of a library."""
    side = abs(tick % 80 - 40) / 20.0 - 1.0
    return {"V1": Command(throttle=0.5, steering=side), "V2": Command(throttle=0.3, steering=-side)}


def film(folder: Path) -> dict[str, str]:
    """Digests of the Model, of all States and of all Frames of a drive, and of results of the C library."""
    world = slalom(folder)
    states, frames = hashlib.sha256(), hashlib.sha256()
    for tick in range(TICKS):
        frame = world.step(drive(tick))
        assert not any(vehicle.collision_count for vehicle in frame.vehicles.values())
        for part in bytes_of(frame):
            frames.update(part)
        for column in world.compiled.state:
            states.update(column.tobytes())
    return {
        "model": model_digest(world.compiled.model),
        "state": states.hexdigest(),
        "frames": frames.hexdigest(),
        "sines": hashlib.sha256(np.array([math.sin(0.001 * i) for i in range(10_000)]).tobytes()).hexdigest(),
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For the files of the cars: the Model has their paths."""
    return tmp_path_factory.mktemp("cars")


@pytest.fixture(scope="module")
def film_under(folder: Path) -> Callable[[str], dict[str, str]]:
    """Makes the digests of `film` in a new process with settings of that name; with none of them for the name ''."""

    @cache
    def made(name: str) -> dict[str, str]:
        program = f"from tests.test_processors import *; print(json.dumps(film(Path({str(folder)!r}))))"
        return json.loads(output("-W", "ignore", "-c", program, **SETTINGS.get(name, {})))

    return made


def output(*command: str | Path, **environment: str) -> str:
    """What a new Python prints, with none of the settings but these."""
    all_ = {key for one in SETTINGS.values() for key in one}
    kept = {key: value for key, value in os.environ.items() if key not in all_}
    done = subprocess.run(
        [sys.executable, *command],
        cwd=ROOT,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("name", SETTINGS)
def test_the_code_of_another_processor_gives_the_same_bits(
    name: str, film_under: Callable[[str], dict[str, str]]
) -> None:
    if name == "OpenBLAS for SkylakeX" and not get_host_cpu_features().get("avx512f"):
        pytest.skip("this processor has no AVX-512: it cannot run code for SkylakeX")
    usual, other = film_under(""), film_under(name)
    for what in ("model", "state", "frames"):
        assert other[what] == usual[what], what


FILM_WITH_WHEEL = """
from tests.test_processors import *
jit.SHIPPED = Path({wheel!r})
compiled = []
with jit.compiling(compiled.append):
    print(json.dumps([film(Path({folder!r})), compiled]))
"""


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.skipif(not jit.runs_baseline(), reason=f"this processor cannot run code for {jit.BASELINE[0]}")
def test_the_compiled_code_of_a_wheel_gives_the_same_bits_and_nothing_is_compiled(
    film_under: Callable[[str], dict[str, str]], folder: Path, tmp_path: Path
) -> None:
    """The code that is made for the wheel is cached: only the first run after a change of the physics compiles it."""
    output("-m", "autodrive.cli.compiled", tmp_path / "wheel")
    program = FILM_WITH_WHEEL.format(wheel=str(tmp_path / "wheel"), folder=str(folder))
    empty = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    other, compiled = json.loads(output("-W", "ignore", "-c", program, **empty, **WHEEL))
    assert compiled == []
    for what in ("model", "state", "frames"):
        assert other[what] == film_under("")[what], what


@pytest.mark.process
@pytest.mark.slow
def test_the_settings_change_the_results_of_the_c_library(film_under: Callable[[str], dict[str, str]]) -> None:
    has_variants = IS_X86 and platform.libc_ver()[0] == "glibc" and get_host_cpu_features()["fma"]
    assert (film_under(next(iter(SETTINGS)))["sines"] != film_under("")["sines"]) == has_variants


@pytest.mark.slow
def test_the_compiled_tick_neither_contracts_operations_nor_calls_functions_of_the_c_library(tmp_path: Path) -> None:
    world = slalom(tmp_path)
    world.step()
    compiled: Any = advance
    fresh: Any = numba.jit(compiled.py_func, **compiled.targetoptions)  # code from the cache cannot be inspected
    for signature in compiled.signatures:
        fresh.compile(signature)
        code = fresh.inspect_llvm(signature)
        assert "mj_step2" in code
        assert re.findall(r"llvm\.fma|llvm\.fmuladd|= f\w+ (?:fast|contract|reassoc)\b.*", code) == []
        called = set(re.findall(r"call[^@\n]*@\"?([\w.]+)", code))
        assert {name for name in called if re.match(r"(llvm\.)?(a?sin|a?cos|a?tan|exp|log|pow|hypot)", name)} == set()
        if IS_X86:
            assert re.findall(r"vfn?m(?:add|sub)\w*", fresh.inspect_asm(signature)) == []
