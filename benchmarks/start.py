"""Time and memory of a start: import, first start with an empty cache, start with a full cache, up to the first tick.

    uv run benchmarks/start.py [SCENARIO]

Each figure is measured in a new Python process, without the start of Python itself.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile

ROUNDS = 7

IMPORT = "import autodrive"

# includes the import of the package
FIRST_TICK = "import autodrive\nworld = autodrive.make({scenario!r})\nworld.step()"

MEASURED = """
import resource, time
begin = time.perf_counter()
{code}
print(time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def measure(code: str, **environment: str) -> tuple[float, float]:
    """Wall time [s] and maximum resident memory [MiB] of that code in a new process."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURED.format(code=code)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, memory = map(float, done.stdout.split())
    return seconds, memory


def main() -> None:
    scenario = sys.argv[1] if len(sys.argv) > 1 else "mini_map"
    first_tick = FIRST_TICK.format(scenario=scenario)
    with tempfile.TemporaryDirectory() as cache:
        first, first_memory = measure(first_tick, NUMBA_CACHE_DIR=cache)
        warm = [measure(first_tick, NUMBA_CACHE_DIR=cache) for _ in range(ROUNDS)]
    light = [measure(IMPORT) for _ in range(ROUNDS)]
    bare = [measure("pass") for _ in range(ROUNDS)]
    report("import autodrive", statistics.median(t for t, _ in light), statistics.median(m for _, m in light))
    title = f"first tick of {scenario}"
    report(f"{title}, full cache", statistics.median(t for t, _ in warm), statistics.median(m for _, m in warm))
    report(f"{title}, empty cache", first, first_memory)
    print(f"{'Python alone':44s}           {statistics.median(m for _, m in bare):6.0f} MiB")


def report(title: str, seconds: float, memory: float) -> None:
    print(f"{title:44s} {seconds:7.3f} s {memory:6.0f} MiB")


if __name__ == "__main__":
    main()
