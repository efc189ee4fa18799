"""uv.lock can be installed from wheels alone on every platform and Python that the project supports."""

from __future__ import annotations

import pytest

from tests.support.lockfile import PLATFORMS, PROJECT, PYTHONS, Platform, needed, packages, wheels


@pytest.mark.parametrize("python", PYTHONS, ids=lambda python: f"{python[0]}.{python[1]}")
@pytest.mark.parametrize("platform", PLATFORMS, ids=lambda platform: platform.name)
@pytest.mark.parametrize("dev", [False, True], ids=["user", "developer"])
def test_every_package_has_a_wheel(platform: Platform, python: tuple[int, int], dev: bool) -> None:
    tags = platform.wheel_tags(python)
    chosen = needed(packages(), platform.environment(python), dev=dev)
    assert {"numpy", "mujoco-core", "numba"} <= {package["name"] for package in chosen}
    without = [
        f"{package['name']} {package['version']}"
        for package in chosen
        if not any(tags & wheel_tags for _, wheel_tags in wheels(package))
    ]
    assert not without, f"no wheel for {platform.name}, Python {python[0]}.{python[1]}: {', '.join(without)}"


def test_the_lock_is_for_this_project_and_uses_uvloop_where_it_exists() -> None:
    assert any(package["name"] == PROJECT for package in packages())
    for platform in PLATFORMS:
        names = {package["name"] for package in needed(packages(), platform.environment((3, 13)))}
        assert ("uvloop" in names) == (platform.sys_platform != "win32")
