"""Ctrl-C while the program starts ends it without a traceback."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.hardening import cases
from tests.support.waiting import LIMIT

PROGRAM = """
import os, signal, sys
from autodrive.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started the tests with SIGINT ignored
number, sys.argv = int(sys.argv[1]), ["autodrive", *sys.argv[2:]]
imports = 0
def interrupt(event, arguments):
    global imports
    if event == "import":
        imports += 1
        if imports == number:
            os.kill(os.getpid(), signal.SIGINT)
sys.addaudithook(interrupt)
main()
"""
"""`autodrive`, which gets the signal at the import of that number."""


@pytest.mark.process
@pytest.mark.parametrize("number", cases([1, 2, 40, 150], list(range(1, 190, 2))))
@pytest.mark.parametrize("arguments", [["--help"], ["run", "plane", "--headless", "--duration", "1000"]])
def test_a_signal_during_the_imports_ends_the_program_at_once_and_without_a_traceback(
    number: int, arguments: list[str]
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(number), *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 130
    assert done.stderr == done.stdout == ""
