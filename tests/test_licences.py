"""The licences of all dependencies are compatible with the project, and the documented list is that of the installed
packages."""

from __future__ import annotations

import pytest

from tests.support.licences import ALLOWED, DOCUMENT, page, page_licences, parts, python_licences


@pytest.mark.parametrize(
    ("name", "licence"),
    [*python_licences(), *page_licences()],
    ids=str,
)
def test_a_licence_is_one_of_those_that_suit_the_project(name: str, licence: str) -> None:
    assert parts(licence) <= ALLOWED, f"{name}: {licence}"


def test_the_document_lists_the_installed_packages() -> None:
    assert page() == DOCUMENT.read_text(encoding="utf-8"), "run  python -m tests.support.licences"


def test_the_page_contains_the_packages_that_it_imports() -> None:
    assert [name for name, _ in page_licences()] == ["@msgpack/msgpack", "three", "uplot"]
