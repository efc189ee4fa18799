"""The licences of all dependencies are compatible with the project, and the documented list is that of the installed
packages."""

from __future__ import annotations

from tests.support.licences import ALLOWED, DOCUMENT, page, page_licences, parts, python_licences


def test_all_licences_suit_the_project() -> None:
    licences = dict([*python_licences(), *python_licences(extras=True), *page_licences()])
    assert len(licences) > 60
    assert {name: licence for name, licence in licences.items() if not parts(licence) <= ALLOWED} == {}


def test_the_document_lists_the_installed_packages() -> None:
    assert page() == DOCUMENT.read_text(encoding="utf-8"), "run  python -m tests.support.licences"


def test_the_page_contains_the_packages_that_it_imports() -> None:
    assert [name for name, _ in page_licences()] == ["@msgpack/msgpack", "three", "uplot"]
