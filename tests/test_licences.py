"""The licences of all dependencies are compatible with the project, and the documented list is that of the installed
packages."""

from __future__ import annotations

import contextlib
from importlib.metadata import PackageNotFoundError

from tests.support.licences import ALLOWED, DOCUMENT, EXTRAS, licence, page, page_licences, parts, python_licences
from tests.support.lockfile import PROJECT, packages


def test_all_licences_suit_the_project() -> None:
    licences = dict([*python_licences(), *page_licences()])
    assert len(licences) > 20
    assert {name: licence for name, licence in licences.items() if not parts(licence) <= ALLOWED} == {}


def test_the_licences_of_the_extras_suit_the_project() -> None:
    for name, (_, stated) in EXTRAS.items():
        assert parts(stated) <= ALLOWED
        with contextlib.suppress(PackageNotFoundError):
            assert licence(name) == stated


def test_the_extras_are_those_of_the_project() -> None:
    (project,) = (package for package in packages() if package["name"] == PROJECT)
    in_lock = {one["name"]: extra for extra, group in project["optional-dependencies"].items() for one in group}
    known = {*dict(python_licences()), "colorama"}  # on Windows the simulator needs it, too
    while needs := {
        one["name"]: in_lock[package["name"]]
        for package in packages()
        if package["name"] in in_lock
        for one in package.get("dependencies", [])
        if one["name"] not in in_lock.keys() | known
    }:
        in_lock |= needs
    assert in_lock == {name: extra for name, (extra, _) in EXTRAS.items()}


def test_the_document_lists_the_installed_packages() -> None:
    assert page() == DOCUMENT.read_text(encoding="utf-8"), "run  python -m tests.support.licences"


def test_the_page_contains_the_packages_that_it_imports() -> None:
    assert [name for name, _ in page_licences()] == ["@msgpack/msgpack", "three", "uplot"]
