"""Mutations: where they are found again."""

import ast
from collections import Counter
from pathlib import Path

import pytest

from tests.mutations import AREAS, EACH, FILE, PACKAGE, Mutation, failures, mutated, place, read

BEFORE = """
class Wheel:
    def turn(self, angle):
        '''Return the angle.'''
        if angle > 1:
            return angle - 1
        elif angle < 0:
            return angle + self.offset(
                angle,  # [rad]
            )
        return 0
"""
MUTATION = Mutation("tick", "off by one", "src/autodrive/wheel.py", "Wheel.turn", "if angle < 0:", "if angle <= 0:", 0)


def write(tree: Path, file: str, source: str) -> Path:
    path = tree / PACKAGE / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(source)
    return path


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("wheel.py", BEFORE),
        ("physics/parts/wheels.py", "import math\n" + BEFORE),
        ("wheel.py", BEFORE.replace("class Wheel", "class FrontWheel")),
        ("wheel.py", BEFORE.replace("elif angle < 0", "elif (\n            angle < 0  # right\n        )")),
    ],
    ids=["the same place", "another file", "another class", "another format"],
)
def test_a_mutation_is_found_again(tmp_path: Path, file: str, source: str) -> None:
    path = write(tmp_path, file, source)
    write(tmp_path, "other.py", "def drive(angle):\n    if angle < 0:\n        return 1\n")
    found = place(MUTATION, tmp_path)
    assert found is not None
    assert found.path == path
    changed = ast.unparse(ast.parse(mutated(MUTATION, found)))
    assert changed == ast.unparse(ast.parse(source)).replace("elif angle < 0:", "elif angle <= 0:")


def test_a_renamed_function_is_found_by_a_long_statement_that_exists_once(tmp_path: Path) -> None:
    mutation = MUTATION._replace(function="roll", before="return angle + self.offset(angle)", after="pass")
    path = write(tmp_path, "wheel.py", BEFORE)
    found = place(mutation, tmp_path)
    assert found is not None
    assert mutated(mutation, found).count("\n") == BEFORE.count("\n") - 2
    write(tmp_path, "copy.py", path.read_text())
    assert place(mutation, tmp_path) is None


@pytest.mark.parametrize("source", [BEFORE.replace("< 0", "< 1"), "def turn(angle):\n    return angle\n"])
def test_a_statement_that_was_changed_has_no_place(tmp_path: Path, source: str) -> None:
    write(tmp_path, "wheel.py", source)
    assert place(MUTATION, tmp_path) is None


def test_each_area_has_the_same_number_of_mutations() -> None:
    assert Counter(mutation.area for mutation in read(FILE)) == dict.fromkeys(AREAS, EACH)


def test_names_and_errors_of_failed_tests_are_read() -> None:
    output = (
        "FAILED tests/a.py::t[max(a, b) - 1] - assert [1] == [2]\nERROR tests/b.py - OSError: x - y\n1 failed in 2 s"
    )
    assert failures(output) == [("tests/a.py::t[max(a, b) - 1]", "assert [1] == [2]"), ("tests/b.py", "OSError: x - y")]
