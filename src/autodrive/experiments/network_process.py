"""The process in which a foreign network runs with limits: its file may ask for any amount of time and memory."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from autodrive.base.child_process import start_module, take_stdout

if sys.platform == "linux":
    import resource

TIME_LIMIT = 8.0
"""Wall time in which a network must be loaded, and in which each run must end [s]."""
MEMORY_LIMIT = 300 * 2**20
"""Memory of a network beside that of onnxruntime [bytes]; on Linux."""
MOST_NUMBERS = 1000
"""Numbers of an output for a car."""
LATE = 1
"""Exit code of a process whose network did not end within the limit: that of `faulthandler`."""


class Tensor(NamedTuple):
    """An input or output of a network."""

    name: str
    type: str
    shape: list[Any]


class Ports(NamedTuple):
    """All that a network reads and writes."""

    inputs: list[Tensor]
    outputs: list[Tensor]


class NetworkError(Exception):
    """A network cannot be loaded, or does not run."""


class NetworkProcess:
    """A running network. Its process ends with this object."""

    def __init__(self, network: bytes) -> None:
        """Raises `NetworkError` if that is no network in the format ONNX, or if it exceeds a limit."""
        self.process = start_module("autodrive.experiments.network_process")
        self._close = weakref.finalize(self, _end, self.process)
        self.ports: Ports = self._answer((network, TIME_LIMIT, MEMORY_LIMIT))

    def run(self, output: str, inputs: Mapping[str, Any]) -> Any:
        """The values of an output. Raises `NetworkError`."""
        return self._answer((output, inputs))

    def _answer(self, request: Any) -> Any:
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None
        assert stdout is not None
        try:
            pickle.dump(request, stdin, pickle.HIGHEST_PROTOCOL)
            stdin.flush()
            answer = pickle.load(stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            answer = NetworkError(self._reason())
        if isinstance(answer, NetworkError):
            raise answer
        return answer

    def _reason(self) -> str:
        """Why the process has ended."""
        self._close()
        code = self.process.returncode
        if code == LATE:
            return f"the network takes more than {TIME_LIMIT:g} s"
        status = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        limit = f"more than {MEMORY_LIMIT // 2**20} MiB of memory are not available"
        return f"the process of the network ended with {status}; {limit}"


def _end(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    process.wait()


def main() -> None:
    """Load the network from stdin, then answer until stdin closes."""
    import onnxruntime  # noqa: PLC0415  an extra

    answers = take_stdout()
    network, seconds, memory = pickle.load(sys.stdin.buffer)

    def answer(work: Callable[[], Any]) -> None:
        faulthandler.dump_traceback_later(seconds, exit=True)  # it works while onnxruntime computes
        try:
            result = work()
        except Exception as error:  # onnxruntime has no common class of its errors
            result = NetworkError(" ".join(str(error).split())[:200])
        faulthandler.cancel_dump_traceback_later()
        pickle.dump(result, answers, pickle.HIGHEST_PROTOCOL)
        answers.flush()

    session: Any = None

    def load() -> Ports:
        nonlocal session
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.enable_cpu_mem_arena = False  # it asks for twice of what is needed
        options.log_severity_level = 4
        onnxruntime.set_seed(0)  # networks that sample their actions
        session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        inputs, outputs = session.get_inputs(), session.get_outputs()
        return Ports(
            *([Tensor(tensor.name, tensor.type, list(tensor.shape)) for tensor in ports] for ports in (inputs, outputs))
        )

    def run(output: str, inputs: Mapping[str, Any]) -> Any:
        (values,) = session.run([output], inputs)
        cars = max((len(array) for array in inputs.values()), default=1)
        if values.size > MOST_NUMBERS * cars:
            raise ValueError(f"output '{output[:100]}' has {values.size} numbers for {cars} cars")
        return values

    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(EOFError):
        os.chdir(folder)  # a file may name others that have its weights: there are none
        _limit_memory(memory)
        answer(load)
        while True:
            output, arrays = pickle.load(sys.stdin.buffer)
            answer(lambda output=output, inputs=arrays: run(output, inputs))


def _limit_memory(size: int) -> None:
    """Limit the memory to `size` bytes more than this process has now."""
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        limit = pages * resource.getpagesize() + size
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
