"""OpenGL without a screen, and the error message for machines that have none."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError

if TYPE_CHECKING:
    import moderngl
else:
    try:
        import moderngl
    except ImportError:  # no wheel for Linux on arm64: the simulator runs without cameras
        moderngl = None

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri"
"""Debian and Ubuntu packages: OpenGL in software, and EGL."""

BUILD_MODERNGL = "apt-get install -y g++ python3-dev libgl-dev libx11-dev && pip install moderngl"
"""Builds moderngl from source on Debian and Ubuntu; there is no wheel for Linux on arm64."""

SHADERS = Path(__file__).parent / "shaders"


_INCLUDED = {
    "FRAME_FIELDS": "frame.glsl",
    "TONE": "tone.glsl",
    "LIGHT_FORMULAS": "light.glsl",
    "SKY_LIGHT": "sky.glsl",
    "SHADOW_FORMULAS": "shadow.glsl",
}


class GlUnavailable(AutodriveError):  # noqa: N818 (the condition is the name)
    """The machine, or this process, has no OpenGL 3.3: cameras cannot be drawn, everything else works."""


def open_context(platform: str = sys.platform) -> moderngl.Context:
    """A new context, current in this thread. Raises `GlUnavailable`.

    Linux: EGL, which needs no display. Elsewhere: moderngl's own choice, WGL (Windows) or CGL (macOS).
    """
    if moderngl is None:
        raise _missing("the Python package moderngl is not installed", BUILD_MODERNGL)
    _check_process()
    options = {"backend": "egl"} if platform.startswith("linux") else {}
    try:
        return moderngl.create_context(require=330, standalone=True, **options)  # pyright: ignore[reportArgumentType]
    except Exception as error:  # each platform raises its own type
        raise _missing(str(error)) from None


@contextmanager
def current(context: moderngl.Context) -> Iterator[moderngl.Context]:
    """Make a context current in this thread, within a block. Raises `GlUnavailable`."""
    _check_process()
    with context:
        yield context


def _missing(reason: str, fix: str = f"apt-get install -y --no-install-recommends {PACKAGES}") -> GlUnavailable:
    one_line = " ".join(reason.split())
    return GlUnavailable(
        f"cameras are unavailable: no OpenGL 3.3 on this machine. On Debian and Ubuntu:  {fix}  ({one_line})"
    )


_user = 0
"""The process that used OpenGL first: this one, or the one that it was forked from. 0: none."""


def is_forked() -> bool:
    """Whether this process was forked from one that has used OpenGL.

    The threads of the OpenGL library exist in the other process only: a call would wait for them for ever.
    """
    return _user not in (0, os.getpid())


def _check_process() -> None:
    """Raises `GlUnavailable` in a forked process."""
    global _user  # noqa: PLW0603  it belongs to the process, as the library does
    _user = _user or os.getpid()
    if is_forked():
        raise GlUnavailable(
            "cameras are unavailable: this process was forked from one that has used OpenGL. Start it with 'spawn':  "
            "multiprocessing.get_context('spawn'); gymnasium.make_vec(..., vectorization_mode='async', "
            "vector_kwargs={'context': 'spawn'}); SubprocVecEnv(..., start_method='spawn')"
        )


@cache
def probe() -> str:
    """Name of the OpenGL renderer of this machine, for example 'llvmpipe (...)'. Raises `GlUnavailable`."""
    context = open_context()
    try:
        return str(context.info["GL_RENDERER"])
    finally:
        context.release()


def is_software(renderer: str) -> bool:
    """Whether a renderer of that name runs on the CPU."""
    return any(word in renderer.lower() for word in ("llvmpipe", "softpipe", "swrast", "software", "swiftshader"))


def write(program: moderngl.Program, uniform: str, data: bytes) -> None:
    """Set a uniform, unless the shader compiler removed it."""
    member = program.get(uniform, None)
    if isinstance(member, moderngl.Uniform):
        member.write(data)


def source(name: str, **definitions: object) -> str:
    """A shader of this package with these macros defined; the words of `_INCLUDED` are files."""
    text = (SHADERS / name).read_text(encoding="utf-8")
    for word, file in _INCLUDED.items():
        text = text.replace(word, (SHADERS / file).read_text(encoding="utf-8")) if word in text else text
    macros = "".join(f"#define {word} {value}\n" for word, value in definitions.items())
    return f"#version 330 core\n{macros}{text}"
