"""Tries an installed simulator: a tick, a scan, an image, the page, and a client. `scripts/release` runs it.

Usage, with the Python of an environment that has a distribution:

    PYTHON -I smoke.py VERSION [CLIENT]       tries autodrive-simulator; CLIENT is the Python of another environment,
                                              which has autodrive-client and drives the simulator
    PYTHON -I smoke.py VERSION --drive LINK   tries autodrive-client with the simulator of this link

It uses public names only, and nothing of the repository.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import autodrive
from autodrive import Command

SIMULATOR = ("mujoco", "numba", "moderngl", "uvicorn")
"""Packages of the simulator that the client does not need."""


def main() -> None:
    """Try what the arguments name; an assertion says what fails."""
    version, rest = sys.argv[1], sys.argv[2:]
    package = Path(autodrive.__file__).parent
    assert autodrive.__version__ == version, f"version {autodrive.__version__} instead of {version}"
    assert (package / "py.typed").is_file(), "py.typed is missing"
    if rest[:1] == ["--drive"]:
        assert importlib.metadata.version("autodrive-client") == version
        try_client(rest[1])
    else:
        assert importlib.metadata.version("autodrive-simulator") == version
        try_world()
        try_page(version, rest[0] if rest else None)


def try_world() -> None:
    """One second of a drive with scans and images."""
    world = autodrive.make("mini_map", seed=1, cameras=True)
    start = world.frame.vehicles["V1"].ips
    frame = world.frame
    while frame.time < 1.0 - 1e-9:
        frame = world.step({"V1": Command(throttle=1.0)})
    car = frame.vehicles["V1"]
    assert start is not None
    assert car.ips is not None
    distance = float(abs(car.ips.position - start.position).max())
    assert 0.05 < distance < 0.5, f"{distance} m in a second; the full speed is 0.44 m/s"
    assert car.lidar is not None, "there is no scan"
    nearest = float(car.lidar.ranges.min())
    assert 0.05 < nearest < 3.0, f"the nearest wall is at {nearest} m, and the map is 5 m long"
    image = car.cameras["front"].rgb
    assert image.shape == (480, 640, 3)
    assert image.std() > 10.0, "the image has one colour"
    print(
        f"tick: {distance:.2f} m in {frame.time:.2f} s; scan: nearest {nearest:.2f} m; image: {image.mean():.0f} of 255"
    )


def try_page(version: str, client: str | None) -> None:
    """The page answers with all its parts, and a client drives, also one of another environment."""
    from autodrive.run import PageOptions, Run, RunObserver, RunOptions, StopRequest, simulate

    links: list[str] = []
    started = threading.Event()
    stop = StopRequest()

    class Observer(RunObserver):
        def serving(self, link: str) -> None:
            links.append(link)

        def started(self, run: Run) -> None:
            started.set()

    options = RunOptions("mini_map", page=PageOptions(port=0), cameras=False)
    thread = threading.Thread(target=simulate, args=(options,), kwargs={"stop": stop, "observer": Observer()})
    thread.start()
    try:
        assert started.wait(300.0), "the run has not started in five minutes"
        parts = load_page(links[0])
        try_client(links[0])
        if client:
            subprocess.run([client, "-I", __file__, version, "--drive", links[0]], check=True)
    finally:
        stop.set()
        thread.join()
    print(f"page: {parts} parts")


def load_page(link: str) -> int:
    """Load the page with the scripts and styles that it names, and return their number."""
    with urllib.request.urlopen(link, timeout=30.0) as answer:
        text = answer.read().decode()
    assert "<title>AutoDRIVE Simulator</title>" in text
    parts = [part for part in re.findall(r'(?:src|href)="\./([^"]+)"', text) if part.endswith((".js", ".css"))]
    assert any(part.endswith(".js") for part in parts)
    for part in parts:
        with urllib.request.urlopen(link.partition("?")[0] + part, timeout=30.0) as answer:
            assert answer.status == 200
            assert len(answer.read()) > 100
    return len(parts)


def try_client(link: str) -> None:
    """A car drives in lock-step."""
    with autodrive.Client(link) as sim, sim.lockstep():
        frame = sim.reset(seed=1)
        start = frame.vehicles["V1"].pose.position[0]
        for _ in range(100):
            frame = sim.step({"V1": Command(throttle=1.0)})
    driven = abs(frame.vehicles["V1"].pose.position[0] - start)
    assert 0.05 < driven < 0.5, f"{driven} m in a second"
    alone = [name for name in SIMULATOR if importlib.util.find_spec(name) is None]
    print(f"client{' without the simulator' if len(alone) == len(SIMULATOR) else ''}: {driven:.2f} m in a second")


if __name__ == "__main__":
    main()
