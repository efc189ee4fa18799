"""Opens video encoders without letting them change the scheduling of threads."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

if sys.platform == "linux":
    import resource

BT_709, LIMITED = 1, 1
"""Numbers in video files of these colours (ITU-T H.273), and of the range 16 to 235 (FFmpeg)."""

_CAPABILITIES_VERSION_3 = 0x20080522
_SYS_NICE = 1 << 23
"""The capability that permits real-time policies: bit of the first word of a set (linux/capability.h)."""


def open_stream(
    container: Any, encoder: str, size: tuple[int, int], rate: Fraction, options: dict[str, str] | None = None
) -> Any:
    """A video stream of a PyAV container whose encoder is open. `size`: width and height [pixels]; `rate`: [Hz].

    Colours are BT.709 in the limited range, and tagged so; there is a keyframe each second.

    As root, SVT-AV1 gives the thread that opens it the policy SCHED_FIFO with the priority 99 and leaves it so, and all
    threads and processes that this thread starts later inherit it: they then displace everything else on the machine.
    """
    # Only fatal errors: by default, SVT-AV1 prints its settings, and at Ctrl-C that it has not got all images.
    os.environ.setdefault("SVT_LOG", "0")
    stream = container.add_stream(encoder, rate=rate, options=options)
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.gop_size = max(1, round(rate))
    context.colorspace = context.color_primaries = context.color_trc = BT_709
    context.color_range = LIMITED
    with _ordinary_scheduling():
        context.open()
    return stream


@contextlib.contextmanager
def _ordinary_scheduling() -> Iterator[None]:
    """Within it, this thread and the threads that it starts cannot get a real-time policy; those threads never can."""
    if sys.platform != "linux":
        yield
        return
    libc = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(_CAPABILITIES_VERSION_3, 0)
    words = (ctypes.c_uint32 * 6)()  # effective, permitted, inheritable: the low words, then the high words
    if libc.capget(header, words) != 0:
        raise OSError(ctypes.get_errno(), "capget")
    effective = words[0]
    limits = resource.getrlimit(resource.RLIMIT_RTPRIO)
    words[0] = effective & ~_SYS_NICE
    try:
        resource.setrlimit(resource.RLIMIT_RTPRIO, (0, limits[1]))
        if libc.capset(header, words) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        yield
    finally:
        words[0] = effective
        libc.capset(header, words)
        resource.setrlimit(resource.RLIMIT_RTPRIO, limits)
