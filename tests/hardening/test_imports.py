"""Attacks on files that others make, maps for tracks and policies: each is read, or refused in words."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.base.errors import SpecError
from autodrive.base.png import encode_png
from autodrive.experiments.policies import Policy
from tests.support.command_line import python
from tests.support.waiting import LIMIT

# -- tracks ---------------------------------------------------------------------------------------------------------

CPU_LIMIT, MEMORY_LIMIT = 10.0, 500.0
"""Processor time [s] and memory [MB] for one map. An idle machine needs less than 5 s; see test_files.py."""
LARGE = 4096
"""Edge of the largest image [pixel]."""


def ring(rows: int, columns: int, *, step: int = 1) -> NDArray[np.uint8]:
    """The map of a round track, with the values of map_server, in squares of so many pixels."""
    y, x = np.ogrid[-1.0 : 1.0 : rows // step * 1j, -1.0 : 1.0 : columns // step * 1j]
    radius = np.hypot(x, y)
    return np.where((radius > 0.6) & (radius < 0.8), 254, 0).astype(np.uint8).repeat(step, 0).repeat(step, 1)


def png(width: int, height: int, depth: int, colour_type: int, data: bytes) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + bytes(4)

    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data, 1)) + chunk(b"IEND", b"")


def checkerboard() -> bytes:
    y, x = np.indices((1000, 1000))
    return encode_png(((x + y) % 2 * 254).astype(np.uint8))


def specks() -> bytes:
    """A track with 15,000 dark pixels, as a scan of paper has them."""
    image = ring(1000, 1000)
    image[1::4, 1::4] = 0
    image[3::4, 3::4] = np.where(image[3::4, 3::4] == 0, 254, image[3::4, 3::4])
    return encode_png(image)


def islands() -> bytes:
    """A track with about 3,000 dark pixels on it."""
    image = ring(1500, 1500)
    image[4::10, 4::10] = 0
    return encode_png(image)


MAPS: dict[str, tuple[float, Callable[[], bytes], str]] = {
    "a tiny resolution": (1e-9, lambda: encode_png(ring(200, 200)), r"resolution \(line 2\): must be at least 0\.0001"),
    "a huge resolution": (
        10.0,
        lambda: encode_png(ring(500, 500)),
        r"resolution \(line 2\): must be at most 1, not 10",
    ),
    "an image one pixel wide": (
        0.05,
        lambda: png(1, 2**24, 8, 0, bytes(2**25)),
        "1 x 16777216 pixels; .* save a smaller image",
    ),
    "islands": (0.05, islands, r"\d+ separate walls; a track has at most 1000: remove the specks"),
    "a checkerboard": (0.05, checkerboard, r"\d+ pixels at borders .* remove the noise"),
    "specks": (0.05, specks, r"\d+ separate free or occupied areas; .* remove the noise"),
    "50 megapixels": (0.01, lambda: encode_png(ring(7000, 7200, step=8)), "7200 x 7000 pixels; at most 16777216"),
    "16 bits and four channels": (
        0.01,
        lambda: png(LARGE, LARGE, 16, 6, bytes(LARGE * (1 + 8 * LARGE))),
        "its pixels have 128 MiB; at most 100 are possible: save it as 8-bit grey",
    ),
    "more data than pixels": (0.05, lambda: png(10, 10, 8, 0, bytes(10**9)), "no free area that is a ring"),
    "the largest image": (0.005, lambda: encode_png(ring(LARGE, LARGE, step=4)), ""),
}
"""Resolution [m], image, and the error; '' if it is read."""

PROGRAM = """
import json, resource, sys, time
from pathlib import Path
from autodrive.base.errors import SpecError
from autodrive.scenario.tracks.importer import import_track
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
for number, path in enumerate(sys.argv[1:]):
    start, text = time.process_time(), ""
    try:
        import_track(Path(path))
    except SpecError as error:
        text = str(error)
    if number == 0:  # it loads the compiled functions
        before = peak()
    else:
        print(json.dumps([text, time.process_time() - start, peak() - before]), flush=True)
"""


def test_a_hostile_map_is_imported_or_refused_in_little_time_and_memory(tmp_path: Path) -> None:
    paths = []
    for number, (resolution, image, _) in enumerate([(0.05, lambda: encode_png(ring(200, 200)), ""), *MAPS.values()]):
        name = f"map_{number}.png"
        (tmp_path / name).write_bytes(image())
        paths.append(tmp_path / f"map_{number}.yaml")
        paths[-1].write_text(f"image: {name}\nresolution: {resolution:.1e}\norigin: [0.0, 0.0, 0.0]\n")
    lines = python("-c", PROGRAM, *paths, limit=4.0 * LIMIT).splitlines()
    for (name, (_, _, message)), line in zip(MAPS.items(), lines, strict=True):
        text, seconds, megabytes = json.loads(line)
        print(f"{name}: {seconds:.1f} s, {megabytes:.0f} MB, {text}")
        assert re.search(message, text) if message else text == "", name
        assert seconds < CPU_LIMIT, name
        assert megabytes < MEMORY_LIMIT, name


# -- policies -------------------------------------------------------------------------------------------------------

ABOUT = {"format": 1, "task": "time_trial", "inputs": ["speed"], "scale": [1.0], "throttle": [0.0, 1.0], "training": {}}


def npy(header: str, data: bytes = b"") -> bytes:
    """An array in a file of its own."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data


def policy(**members: bytes | NDArray[Any]) -> bytes:
    """The file of a policy with these members instead."""
    whole = {
        "about": np.array(json.dumps(ABOUT)),
        "weight_0": np.ones((2, 1), np.float32),
        "bias_0": np.zeros(2, np.float32),
        **members,
    }
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in whole.items():
            with file.open(f"{name}.npy", "w") as member:
                if isinstance(content, bytes):
                    member.write(content)
                else:
                    np.save(member, content, allow_pickle=False)
    return archive.getvalue()


def about(text: str) -> bytes:
    return policy(about=np.array(text))


HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (%s,), }"
POLICIES: dict[str, Callable[[], bytes]] = {
    "an array of 4 TB": lambda: policy(weight_0=npy(HUGE % 2**39)),
    "an array of 10^300 numbers": lambda: policy(weight_0=npy(HUGE % 10**300)),
    "a header of 100,000 brackets": lambda: policy(weight_0=npy("(" * 60_000)),
    "a header that is no dictionary": lambda: policy(weight_0=npy("1")),
    "100 MB of zeros in 100 kB": lambda: policy(zeros=bytes(100 * 2**20)),
    "objects": lambda: policy(
        weight_0=npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"cos\nsystem\n.")
    ),
    "complex numbers": lambda: policy(weight_0=np.ones((2, 1), complex)),
    "infinite numbers": lambda: policy(weight_0=np.full((2, 1), 1e300)),
    "deep JSON": lambda: about("[" * 100_000),
    "a scale of 10^400": lambda: about(json.dumps({**ABOUT, "scale": [10**400]})),
    "a list": lambda: about("[]"),
}


@pytest.mark.parametrize("attack", POLICIES)
def test_a_hostile_policy_is_refused_in_one_line(attack: str, tmp_path: Path) -> None:
    file = tmp_path / "policy.npz"
    file.write_bytes(POLICIES[attack]())
    with pytest.raises(SpecError, match=r"policy\.npz") as error:
        Policy.load(file)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 1000
