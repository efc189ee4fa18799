"""Cost of recording, size of the file, and time to open it and to find a Frame in it.

python benchmarks/recording.py [MINUTES]

Prints processor time of the recorder alone (the world is stepped the same way without it), for a run with 100 Frames
and 7 scans in a second, without images and with those of two cameras of 640x480 at 30 Hz; drawing them is not counted.
The times are for a file of MINUTES (default 5) of simulated time without images. All times are processor time, which
other programs change less than wall time.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from pathlib import Path

import autodrive
from autodrive import Command, Frame, World
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording


def drive(world: World, ticks: int) -> float:
    """Processor time of a drive [s]."""
    began = time.process_time()
    for tick in range(ticks):
        world.step({"V1": Command(0.5, 0.3 if tick % 400 < 200 else -0.3)} if tick % 2 == 0 else None)
    return time.process_time() - began


def images_cost(seconds: float) -> None:
    """Processor time of recording drawn Frames with two cameras, in a share of a core, and the size of the images.

    The first second does not count: the recorder imports packages there.
    """
    world = autodrive.make("mini_map", cameras=True)
    count, start, ticks = 0, 100, round(100 * seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "images.mcap"
        cost, size, known = 0.0, 0, {}
        with Recorder(path, world, has_meshes=False) as recorder:
            publish = recorder.publish

            def measured(frame: Frame) -> None:
                nonlocal cost
                began = time.process_time()
                publish(frame)
                cost += time.process_time() - began

            recorder.publish = measured  # type: ignore[method-assign]
            for tick in range(start + ticks):
                if tick == start:
                    cost, count, size = 0.0, 0, path.stat().st_size
                cameras = world.step({"V1": Command(0.5, 0.3 if tick % 400 < 200 else -0.3)}).vehicles["V1"].cameras
                count += sum(known.get(name) is not image for name, image in cameras.items())
                known = dict(cameras)
        rate, size = count / seconds, path.stat().st_size - size
    print(
        f"recording with {rate:.0f} images of 640x480 in a second: {100 * cost / seconds:.1f} % of a core, "
        f"{60 * size / seconds / 1e6:.0f} MB a minute"
    )


def main() -> None:
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    ticks = round(6000 * minutes)
    world = autodrive.make("mini_map")
    drive(world, 1000)
    world.reset()
    without = drive(world, ticks)
    world.reset()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        with Recorder(path, world, has_meshes=False):
            recorded = drive(world, ticks)
        cost = (recorded - without) / ticks
        print(f"recording: {1e6 * cost:.0f} us a tick, {100 * cost / 0.01:.2f} % of a core at 100 Hz")
        print(f"size: {path.stat().st_size / minutes / 1e6:.2f} MB a minute, without images and meshes")
        began = time.process_time()
        recording = open_recording(path)
        _ = recording.duration, recording.scenario
        print(f"open: {1e3 * (time.process_time() - began):.1f} ms, a file of {minutes:g} minutes")
        numbers = random.Random(0)
        times = []
        for _ in range(200):
            wanted = numbers.uniform(0.0, recording.duration)
            began = time.process_time()
            recording.frame_at(wanted)
            times.append(time.process_time() - began)
        times.sort()
        print(f"seek: {1e3 * times[100]:.1f} ms (median), {1e3 * times[-1]:.1f} ms (longest of 200)")
        began = time.process_time()
        _ = recording["V1/ips/position"]
        print(f"signal of {ticks} Frames: {time.process_time() - began:.2f} s")
        recording.close()
    images_cost(10.0)


if __name__ == "__main__":
    main()
