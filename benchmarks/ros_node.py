"""What the benchmarks of ROS 1 and ROS 2 have in common: what is read, how late it is, and what a process costs."""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path
from typing import NamedTuple

from autodrive import Client

SECONDS = 15.0
CASES = [("devkit", "raw"), ("direct", "none"), ("direct", "compressed"), ("direct", "raw")]
"""Mode, and which pictures are read."""
ROOT = "/autodrive/nigel_1"
PICTURES = {
    "none": {},
    "compressed": {f"{ROOT}/{side}_camera/image_raw/compressed": "CompressedImage" for side in ("front", "rear")},
    "raw": {f"{ROOT}/{side}_camera/image_raw": "Image" for side in ("front", "rear")},
}

Heard = list[tuple[str, float, float]]
"""Topic, stamp and wall time [s] of each message."""


class Seen(NamedTuple):
    """What a native client saw meanwhile: wall time less simulated time of each Frame, and arrivals of pictures [s]."""

    frames: dict[float, float]
    pictures: dict[float, float]

    def lag(self, wall: float, stamp: float) -> float:
        """From that simulated time on: the fastest Frames of the second around it say when that was [s]."""
        return wall - stamp - min(offset for time_, offset in self.frames.items() if abs(time_ - stamp) < 0.5)


def head() -> None:
    print(f"load {os.getloadavg()[0]:.1f}")
    print(f"{'mode':>7} {'pictures':>10} {'CPU %':>6} {'scan ms':>8} {'picture ms':>10} {'of a camera':>11}")


def report(mode: str, pictures: str, share: float, seen: Seen, heard: Heard) -> None:
    """A line of the table. The devkit protocol has no time stamps: there the stamps are those of the node."""
    scans = [seen.lag(wall, stamp) for topic, stamp, wall in heard if _is_scan(topic) and mode == "direct"]
    shown = [(round(stamp, 6), wall) for topic, stamp, wall in heard if "front_camera" in topic]
    late = [wall - seen.pictures[stamp] for stamp, wall in shown if stamp in seen.pictures]
    rate = len(shown) / (SECONDS - 2.0)
    print(
        f"{mode:>7} {pictures:>10} {100.0 * share:6.1f} {median(scans):>8} {median(late):>10} {rate:8.1f} Hz",
        flush=True,
    )


def _is_scan(topic: str) -> bool:
    return topic.endswith(("lidar", "scan"))


def median(values: list[float]) -> str:
    return f"{1e3 * statistics.median(values):.2f}" if values else "-"


def watched(port: int, picture_rate: float) -> Seen:
    """For some seconds."""
    seen = Seen({}, {})
    with Client(f"127.0.0.1:{port}", picture_rate=picture_rate, picture_quality=90) as sim:
        end = time.time() + SECONDS
        while time.time() < end:
            frame = sim.wait()
            now = time.time()
            seen.frames[frame.time] = now - frame.time
            if picture := sim.pictures.get(("V1", "front")):
                seen.pictures.setdefault(round(picture.time, 6), now)
    return seen


def cpu(pid: int) -> float:
    """Time that it and its threads have used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
