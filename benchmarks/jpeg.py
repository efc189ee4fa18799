"""Cost of sending the images of both cameras to a devkit script: JPEG and base64.

    uv run benchmarks/jpeg.py [SCENARIO]

Median CPU time of one core [ms]. The images are rendered, so that their size in bytes is realistic.
"""

from __future__ import annotations

import base64
import statistics
import sys
import time

import autodrive
from autodrive.graphics.cameras.jpeg import JpegEncoder, images_of

ROUNDS = 201
KINDS = [(None, 75), (None, 90), ((320, 240), 75), ((1280, 720), 75)]


def main() -> None:
    world = autodrive.make(sys.argv[1] if len(sys.argv) > 1 else "mini_map", cameras=True)
    cameras = next(iter(world.frame.vehicles.values())).cameras
    width, height = next(iter(cameras.values())).rgba.shape[1::-1]
    print(f"{'size':>10} {'quality':>7} {'JPEG':>7} {'base64':>7} {'both':>7}   {'bytes of one':>12}")
    for size, quality in KINDS:
        jpeg_times, text_times = [], []
        jpegs = {}
        for _ in range(ROUNDS):
            started = time.thread_time()
            jpegs = images_of(world.frame, encoder=JpegEncoder(size, quality))  # a new encoder has no cached image
            encoded = time.thread_time()
            for jpeg in jpegs.values():
                base64.b64encode(jpeg).decode()
            jpeg_times.append(1e3 * (encoded - started))
            text_times.append(1e3 * (time.thread_time() - encoded))
        jpeg_time, text_time = statistics.median(jpeg_times), statistics.median(text_times)
        w, h = size or (width, height)
        print(
            f"{f'{w}x{h}':>10} {quality:7} {jpeg_time:7.2f} {text_time:7.2f} {jpeg_time + text_time:7.2f}"
            f"   {max(map(len, jpegs.values())):12}"
        )
    world.close()


if __name__ == "__main__":
    main()
