"""Reads uv.lock: the packages that an environment needs, and the wheels that fit it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags, mac_platforms
from packaging.utils import parse_wheel_filename

LOCK = Path(__file__).parents[2] / "uv.lock"
PROJECT = "autodrive-simulator"

Package = dict[str, Any]

GLIBC = 31
"""Linux systems have at least glibc 2.31, that of Debian 11 and Ubuntu 20.04."""


class Platform(NamedTuple):
    """An operating system and processor: its values in environment markers, and the platform tags of its wheels."""

    name: str
    sys_platform: str
    system: str
    machine: str
    tags: tuple[str, ...]

    def environment(self, python: tuple[int, int]) -> dict[str, str]:
        """Values of the environment markers for a version of CPython."""
        version = f"{python[0]}.{python[1]}"
        return {
            "implementation_name": "cpython",
            "implementation_version": f"{version}.0",
            "os_name": "nt" if self.sys_platform == "win32" else "posix",
            "platform_machine": self.machine,
            "platform_python_implementation": "CPython",
            "platform_release": "",
            "platform_system": self.system,
            "platform_version": "",
            "python_full_version": f"{version}.0",
            "python_version": version,
            "sys_platform": self.sys_platform,
        }

    def wheel_tags(self, python: tuple[int, int]) -> frozenset[Tag]:
        """Tags of the wheels that pip installs there."""
        interpreter = f"cp{python[0]}{python[1]}"
        return frozenset((*cpython_tags(python, platforms=self.tags), *compatible_tags(python, interpreter, self.tags)))


def _linux(machine: str) -> Platform:
    old = ("manylinux2014", "manylinux2010", "manylinux1") if machine == "x86_64" else ("manylinux2014",)
    new = (f"manylinux_2_{minor}" for minor in range(GLIBC, 4, -1))
    return Platform(f"linux-{machine}", "linux", "Linux", machine, tuple(f"{tag}_{machine}" for tag in (*new, *old)))


PLATFORMS = (
    _linux("x86_64"),
    _linux("aarch64"),
    Platform("macos-arm64", "darwin", "Darwin", "arm64", tuple(mac_platforms((14, 0), "arm64"))),
    Platform("windows-amd64", "win32", "Windows", "AMD64", ("win_amd64",)),
)
PYTHONS = ((3, 11), (3, 12), (3, 13), (3, 14))


@cache
def packages() -> list[Package]:
    """Every package of the lock."""
    return tomllib.loads(LOCK.read_text(encoding="utf-8"))["package"]


def needed(
    locked: list[Package], environment: dict[str, str] | None = None, *, extras: bool = True, dev: bool = False
) -> list[Package]:
    """The packages that the project needs in an environment (None: this one), without itself.

    `extras` adds those of all extras, `dev` the dependency groups.
    """
    (project,) = (package for package in locked if package["name"] == PROJECT)
    wanted: list[tuple[Package, tuple[str, ...]]] = [
        (dependency, ())
        for group in (
            project.get("dependencies", []),
            *(project.get("optional-dependencies", {}).values() if extras else ()),
            *(project.get("dev-dependencies", {}).values() if dev else ()),
        )
        for dependency in group
    ]
    found: dict[str, Package] = {}
    seen: set[tuple[str, tuple[str, ...]]] = set()
    while wanted:
        dependency, _ = wanted.pop()
        if not _applies(dependency, environment):
            continue
        package = _named(locked, dependency, environment)
        key = package["name"], tuple(dependency.get("extra", ()))
        if key in seen or package["name"] == PROJECT:
            continue
        seen.add(key)
        found[package["name"]] = package
        optional = package.get("optional-dependencies", {})
        wanted += [(one, ()) for one in package.get("dependencies", [])]
        wanted += [(one, ()) for extra in dependency.get("extra", ()) for one in optional.get(extra, [])]
    return list(found.values())


def wheels(package: Package) -> Iterator[tuple[str, frozenset[Tag]]]:
    """Address and tags of each wheel."""
    for wheel in package.get("wheels", []):
        yield wheel["url"], parse_wheel_filename(wheel["url"].rsplit("/", 1)[1].replace("%2B", "+"))[3]


def _applies(dependency: Package, environment: dict[str, str] | None) -> bool:
    return "marker" not in dependency or Marker(dependency["marker"]).evaluate(environment)


def _named(locked: list[Package], dependency: Package, environment: dict[str, str] | None) -> Package:
    """The package of a dependency; where the lock has several versions, the one for the environment."""
    (one,) = (
        package
        for package in locked
        if package["name"] == dependency["name"]
        and dependency.get("version", package.get("version")) == package.get("version")
        and any(
            Marker(marker).evaluate(environment)
            for marker in package.get("resolution-markers", ["python_version > '3'"])
        )
    )
    return one
