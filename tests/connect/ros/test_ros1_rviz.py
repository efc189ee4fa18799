"""RViz on a virtual screen: it shows the vehicle, the scan and the images."""

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
from autodrive.base.png import encode_png
from tests.support.ros.processes import ROOT
from tests.support.ros.ros1 import Ros1
from tests.support.waiting import wait_until

SHOT = ROOT / "test-artefacts" / "ros1_rviz.png"
SCENE = np.s_[62:800, 370:1010]
IMAGES = {"front": np.s_[90:428, 1044:1496], "rear": np.s_[466:804, 1044:1496]}
"""Their places in a window of 1500 x 900."""

Pixels = NDArray[np.uint8]


@pytest.fixture
def display() -> Iterator[str]:
    """Number of a virtual screen with the size of the window."""
    if not all(map(shutil.which, ("rviz", "Xvfb", "import"))):
        pytest.skip("rviz, xvfb and imagemagick are not installed")
    reader, writer = os.pipe()
    # -noreset: the server must not restart when a screenshot client has disconnected and RViz has not connected yet
    command = ["Xvfb", "-noreset", "-displayfd", str(writer), "-screen", "0", "1500x900x24", "+extension", "GLX"]
    with subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL) as screen:
        os.close(writer)
        with os.fdopen(reader) as number:
            yield f":{number.readline().strip()}"
        screen.terminate()


def screenshot(display: str) -> Pixels:
    """RGB."""
    command = ["import", "-silent", "-window", "root", "-depth", "8", "rgb:-"]
    data = subprocess.run(command, env={**os.environ, "DISPLAY": display}, capture_output=True, check=True).stdout
    return np.frombuffer(data, np.uint8).reshape(900, 1500, 3)


def counted(pixels: Pixels, least: tuple[int, int, int], most: tuple[int, int, int]) -> int:
    """Number of pixels between the two colours."""
    return int(((pixels >= least) & (pixels <= most)).all(axis=-1).sum())


def correlation(panel: Pixels, picture: Pixels) -> float:
    """Correlation of both at the same low resolution: RViz scales the image to the panel."""

    def coarse(image: Pixels) -> NDArray[np.float64]:
        rows = np.linspace(0, len(image), 31).astype(int)
        columns = np.linspace(0, len(image[0]), 41).astype(int)
        sums = np.add.reduceat(np.add.reduceat(image.astype(float), rows[:-1], 0), columns[:-1], 1)
        return sums / (np.diff(rows)[:, None, None] * np.diff(columns)[None, :, None])

    return float(np.corrcoef(coarse(panel).ravel(), coarse(picture).ravel())[0, 1])


@pytest.mark.wall_clock  # RViz sometimes hangs or crashes at its start on a virtual screen: it is started again
def test_rviz_shows_the_scan_the_vehicle_and_its_images(ros1_session: Ros1, display: str, gl: str) -> None:
    with Client(f"127.0.0.1:{ros1_session.port}", picture_rate=5.0, picture_quality=90) as sim:
        sim.reset()
        sim.teleport("V1", 3.2, -1.2, -0.8)  # near the walls, which the LIDAR sees, and off the road
        wait_until(lambda: sim.wait() and len(sim.pictures) == len(IMAGES))
        arguments = f"port:={ros1_session.port}", "picture_rate:=5"
        with ros1_session.launch("simulator_bringup_headless.launch", *arguments):
            attempts = (attempt(ros1_session, sim, display, limit) for limit in (20.0, 20.0, 40.0, 80.0, 120.0))
            shown = next((screen for screen in attempts if screen is not None), None)
    assert shown is not None, "RViz did not show everything"
    SHOT.parent.mkdir(exist_ok=True)
    SHOT.write_bytes(encode_png(shown))


def attempt(session: Ros1, sim: Client, display: str, limit: float) -> Pixels | None:
    """The screen of a new RViz, once it shows everything; None if it ends early, or after the time limit [s]."""
    variables = {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
    variables["XDG_RUNTIME_DIR"] = str(session.folder)
    with session.launch("rviz.launch", variables=variables) as program:
        end = time.monotonic() + limit
        while time.monotonic() < end:
            if program.process.poll() is not None:
                return None
            sim.wait()
            if is_complete(screen := screenshot(display), sim):
                return screen
            time.sleep(0.25)
    return None


def is_complete(screen: Pixels, sim: Client) -> bool:
    scene = screen[SCENE]
    return (
        counted(scene, (200, 0, 0), (255, 80, 80)) > 300  # scan
        and counted(scene, (150, 110, 0), (255, 220, 60)) > 100  # hubs of the wheels
        and counted(scene, (0, 0, 60), (70, 110, 200)) > 1000  # plates of the chassis
        and all(correlation(screen[panel], sim.image("V1", camera)) > 0.9 for camera, panel in IMAGES.items())
    )
