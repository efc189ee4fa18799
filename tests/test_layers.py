"""The shape of the package; that imports go down its groups is a contract of import-linter in pyproject.toml."""

from __future__ import annotations

from tests.support import layers
from tests.support.layers import GROUPS, PACKAGE, name_of


def test_there_are_few_arrows_between_groups() -> None:
    assert len(layers.arrows()) <= 50


def test_no_group_has_more_than_a_fifth_of_the_lines() -> None:
    lines = {group: layers.lines_of(group) for group in GROUPS}
    assert {group: count for group, count in lines.items() if count > sum(lines.values()) / 5} == {}


def test_there_is_no_module_called_utils() -> None:
    for path in PACKAGE.rglob("*.py"):
        assert not any(word in path.stem for word in ("util", "helper", "manager", "common", "misc")), name_of(path)


def test_table_and_picture_in_the_architecture_are_those_of_the_code() -> None:
    text = layers.ARCHITECTURE.read_text(encoding="utf-8")
    assert layers.BEGIN + layers.table() + layers.END in text, "run: python -m tests.support.layers"
    assert layers.picture() == layers.PICTURE.read_text(encoding="utf-8"), "run: python -m tests.support.layers"
