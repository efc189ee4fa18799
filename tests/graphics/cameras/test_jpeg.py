"""JPEG images: close to the original, encoded once, with the requested size and quality."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import simplejpeg

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.jpeg import JpegEncoder, images_of
from autodrive.graphics.cameras.resize import resized
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Pose


def image(width: int = 64, height: int = 48) -> CameraImage:
    """A smooth image: red increases to the right, green downwards."""
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., 0] = np.linspace(0, 255, width)
    rgba[..., 1] = np.linspace(0, 255, height)[:, None]
    rgba[..., 2] = 60
    pinhole = CameraIntrinsics(width, height, 50.0, 50.0, 0.5 * width, 0.5 * height)
    return CameraImage(0.0, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), pinhole, rgba)


def frame(**cameras: CameraImage) -> Any:
    return SimpleNamespace(vehicles={"V1": SimpleNamespace(cameras=cameras)})


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(10.0 * np.log10(255.0**2 / np.mean((one.astype(float) - other) ** 2)))


def test_images_are_baseline_jpeg_in_colour_and_close_to_the_original() -> None:
    seen = image()
    jpeg = JpegEncoder().encode("V1", "front", seen)
    assert b"\xff\xc0" in jpeg  # SOF0, baseline; progressive would be SOF2
    assert b"\xff\xc2" not in jpeg
    assert simplejpeg.decode_jpeg_header(jpeg)[2] == "YCbCr"
    decoded = simplejpeg.decode_jpeg(jpeg)
    assert decoded.shape == (48, 64, 3)
    assert psnr(decoded, seen.rgb) > 35.0
    assert simplejpeg.decode_jpeg(JpegEncoder(size=(32, 20)).encode("V1", "front", seen)).shape == (20, 32, 3)


def test_each_image_is_encoded_once_for_all_threads() -> None:
    encoder, seen = JpegEncoder(), image()
    threads = [threading.Thread(target=encoder.encode, args=("V1", "front", seen)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert encoder.encode("V1", "front", seen) is encoder.encode("V1", "front", seen)
    assert encoder.encoded == 1
    encoder.encode("V1", "front", image())  # another image with equal pixels
    encoder.encode("V1", "rear", seen)
    encoder.encode("V1", "rear", seen, quality=20)
    assert encoder.encoded == 4


def test_higher_quality_needs_more_bytes_and_is_closer() -> None:
    noisy = image(128, 96)
    noisy.rgba[..., :3] = np.random.default_rng(1).integers(0, 256, (96, 128, 3))
    jpegs = [JpegEncoder(quality=quality).encode("V1", "front", noisy) for quality in (10, 50, 95)]
    assert sorted(map(len, jpegs)) == list(map(len, jpegs))
    ratios = [psnr(simplejpeg.decode_jpeg(jpeg), noisy.rgb) for jpeg in jpegs]
    assert sorted(ratios) == ratios


def test_images_of_a_frame_are_those_that_it_has() -> None:
    encoder = JpegEncoder(quality=80)
    seen = frame(front=image(), rear=image(32, 24))
    jpegs = images_of(seen, encoder=encoder)
    assert {key: simplejpeg.decode_jpeg(jpeg).shape for key, jpeg in jpegs.items()} == {
        ("V1", "front"): (48, 64, 3),
        ("V1", "rear"): (24, 32, 3),
    }
    assert images_of(seen, 0.5, encoder=encoder)["V1", "front"] == JpegEncoder(quality=40).encode(
        "V1", "front", seen.vehicles["V1"].cameras["front"]
    )
    assert images_of(frame(), encoder=encoder) == {}


@pytest.mark.parametrize("options", [{"quality": 0}, {"quality": 101}, {"size": (0, 10)}])
def test_invalid_sizes_and_qualities_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(AutodriveError, match="usual"):
        JpegEncoder(**options)


def test_half_the_size_is_the_mean_of_four_pixels() -> None:
    rgba = np.random.default_rng(2).integers(0, 256, (48, 64, 4)).astype(np.uint8)
    means = rgba.reshape(24, 2, 32, 2, 4)[..., :3].mean(axis=(1, 3))
    np.testing.assert_allclose(resized(rgba, 32, 24)[..., :3], means, atol=0.51)
    assert resized(rgba, 64, 48) is rgba  # not copied


@pytest.mark.parametrize("size", [(37, 29), (64, 20), (100, 48), (150, 113), (1, 1)])
def test_any_size_keeps_a_ramp_a_ramp(size: tuple[int, int]) -> None:
    width, height = size
    rgba = np.zeros((48, 64, 4), np.uint8)
    rgba[..., 0] = 10 + 3 * np.arange(64)
    rgba[..., 1] = 10 + 5 * np.arange(48)[:, None]
    small = resized(rgba, width, height).astype(float)
    assert small.shape == (height, width, 4)
    x = np.clip((np.arange(width) + 0.5) * 64 / width - 0.5, 0.0, 63.0)  # centres of pixels, in old pixels
    y = np.clip((np.arange(height) + 0.5) * 48 / height - 0.5, 0.0, 47.0)
    np.testing.assert_allclose(small[..., 0], np.broadcast_to(10 + 3 * x, (height, width)), atol=0.75)
    np.testing.assert_allclose(small[..., 1], np.broadcast_to(10 + 5 * y[:, None], (height, width)), atol=0.75)
    assert (small[..., 3] == 255).all()
