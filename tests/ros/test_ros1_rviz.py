"""RViz on a screen that nobody sees: what it draws of the vehicle, its scan and its pictures."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive import Client
from autodrive.render.png import write_png
from tests.ros.ros1 import Stage, launched
from tests.ros.running import ROOT, Running

SHOT = ROOT / "test-artefacts" / "ros1_rviz.png"
SCENE = np.s_[62:800, 370:1010]
PICTURES = {"front": np.s_[90:428, 1044:1496], "rear": np.s_[466:804, 1044:1496]}
"""Where they are in a window of 1500 x 900."""

Pixels = NDArray[np.uint8]


@pytest.fixture
def display() -> Iterator[str]:
    """Of a screen as large as the window."""
    if not all(map(shutil.which, ("rviz", "Xvfb", "import"))):
        pytest.skip("rviz, xvfb and imagemagick are not installed")
    told, tell = os.pipe()
    # not to begin anew when whoever took a picture has left, while RViz is just coming
    command = ["Xvfb", "-noreset", "-displayfd", str(tell), "-screen", "0", "1500x900x24", "+extension", "GLX"]
    with subprocess.Popen(command, pass_fds=[tell], stderr=subprocess.DEVNULL) as screen:
        os.close(tell)
        with os.fdopen(told) as number:
            yield f":{number.readline().strip()}"
        screen.terminate()


def shot(display: str) -> Pixels:
    """What is on the screen, RGB."""
    command = ["import", "-silent", "-window", "root", "-depth", "8", "rgb:-"]
    data = subprocess.run(command, env={**os.environ, "DISPLAY": display}, capture_output=True, check=True).stdout
    return np.frombuffer(data, np.uint8).reshape(900, 1500, 3)


def counted(pixels: Pixels, least: tuple[int, int, int], most: tuple[int, int, int]) -> int:
    """Pixels between the two colours."""
    return int(((pixels >= least) & (pixels <= most)).all(axis=-1).sum())


def likeness(panel: Pixels, picture: Pixels) -> float:
    """Correlation of both, of the same size and coarse: RViz scales the picture to the panel."""

    def coarse(image: Pixels) -> NDArray[np.float64]:
        rows = np.linspace(0, len(image), 31).astype(int)
        columns = np.linspace(0, len(image[0]), 41).astype(int)
        sums = np.add.reduceat(np.add.reduceat(image.astype(float), rows[:-1], 0), columns[:-1], 1)
        return sums / (np.diff(rows)[:, None, None] * np.diff(columns)[None, :, None])

    return float(np.corrcoef(coarse(panel).ravel(), coarse(picture).ravel())[0, 1])


def test_rviz_draws_the_scan_the_vehicle_and_its_pictures(stage: Stage, display: str, gl: str) -> None:
    software = {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
    at = stage._replace(environment=stage.environment | software | {"XDG_RUNTIME_DIR": str(stage.folder)})
    with Client(f"127.0.0.1:{stage.port}", picture_rate=5.0, picture_quality=90) as sim:
        sim.reset()
        sim.teleport("V1", 3.2, -1.2, -0.8)  # near the walls, which the LIDAR sees, and off the road
        attempts = (drawn_in_time(at, sim, display) for _ in range(6))
        seen = next((one for one in attempts if one is not None), None)
    assert seen is not None, "RViz never drew it all"
    SHOT.parent.mkdir(exist_ok=True)
    write_png(SHOT, seen)


def drawn_in_time(stage: Stage, sim: Client, display: str) -> Pixels | None:
    """The screen of an RViz with all on it; on a virtual screen, RViz sometimes hangs at its start."""
    with launched(stage, "simulator_bringup_rviz.launch", f"port:={stage.port}") as running:
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            if found := drawn(sim, shot(display), running):
                return found[0]
    return None


def drawn(sim: Client, screen: Pixels, running: Running) -> tuple[Pixels] | None:
    """The screen, once all is on it."""
    assert running.process.poll() is None, running.words.read_text()
    sim.wait()
    scene = screen[SCENE]
    is_there = (
        counted(scene, (200, 0, 0), (255, 80, 80)) > 300  # scan
        and counted(scene, (150, 110, 0), (255, 220, 60)) > 100  # hubs of the wheels
        and counted(scene, (0, 0, 60), (70, 110, 200)) > 1000  # plates of the chassis
        and all(
            ("V1", camera) in sim.pictures and likeness(screen[panel], sim.image("V1", camera)) > 0.9
            for camera, panel in PICTURES.items()
        )
    )
    return (screen,) if is_there else None
