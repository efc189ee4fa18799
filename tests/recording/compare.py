"""Compares Frames bit by bit."""

from typing import Any

import numpy as np


def assert_same(a: Any, b: Any, path: str = "frame") -> None:
    """Of images, only the time: JPEG changes the pixels."""
    if isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            if path.endswith(".cameras"):
                assert a[key].time == b[key].time, path
            else:
                assert_same(a[key], b[key], f"{path}[{key}]")
    elif hasattr(a, "__struct_fields__"):
        assert type(a) is type(b), path
        for field in a.__struct_fields__:
            assert_same(getattr(a, field), getattr(b, field), f"{path}.{field}")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.tobytes()) == (b.dtype, b.tobytes()), path
    elif isinstance(a, tuple):
        assert len(a) == len(b), path
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            assert_same(one, other, f"{path}[{i}]")
    else:
        assert (type(a), a) == (type(b), b), path
