"""Runs the unit tests of the page (web/tests) in Node: logic without a browser."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.process
def test_unit_tests_of_the_page_pass() -> None:
    done = subprocess.run(
        ["scripts/page", "--test"], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    assert done.returncode == 0, done.stdout
