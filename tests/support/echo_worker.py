"""A worker that draws nothing: sends `Ready` with its set-up, then `Ready` with each line that it receives."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from typing import BinaryIO

import msgspec

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.worker import Ready, serve


def _work(requests: BinaryIO) -> Iterator[msgspec.Struct]:
    yield Ready(str(pickle.load(requests)))
    print("this must not reach the simulator")
    for line in requests:
        request = msgspec.json.decode(line, type=Ready)
        if request.renderer == "expected error":
            raise AutodriveError("an error\nof ours")
        if request.renderer == "unexpected error":
            raise ZeroDivisionError("by zero")
        yield request


if __name__ == "__main__":
    serve(_work, "echoes")
