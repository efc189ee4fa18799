"""OpenGL without a screen, and what to tell a person whose machine has none."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import moderngl

from autodrive.errors import AutodriveError

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri"
"""Of Debian and Ubuntu: OpenGL in software and the way to it without a screen."""

SHADERS = Path(__file__).parent / "shaders"


class GlUnavailable(AutodriveError):  # noqa: N818 (what is wrong is that it is not there)
    """There is no OpenGL 3.3 here; the cameras cannot be drawn, all else works."""

    def __init__(self, reason: str) -> None:
        one_line = " ".join(reason.split())
        super().__init__(
            "cameras are unavailable: no OpenGL 3.3 on this machine. On Debian and Ubuntu:  apt-get install -y "
            f"--no-install-recommends {PACKAGES}  ({one_line})"
        )


def open_context() -> moderngl.Context:
    """A context of its own, current in this thread. Raises `GlUnavailable`."""
    options = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    try:
        return moderngl.create_context(require=330, standalone=True, **options)  # pyright: ignore[reportArgumentType]
    except Exception as error:  # each platform raises its own kind
        raise GlUnavailable(str(error)) from None


@cache
def probe() -> str:
    """Name of what draws here, for example 'llvmpipe (...)'. Raises `GlUnavailable`."""
    context = open_context()
    try:
        return str(context.info["GL_RENDERER"])
    finally:
        context.release()


def is_software(renderer: str) -> bool:
    """Whether a renderer of that name works on the processor."""
    return any(word in renderer.lower() for word in ("llvmpipe", "softpipe", "swrast", "software", "swiftshader"))


def write(program: moderngl.Program, uniform: str, data: bytes) -> None:
    """Set a uniform, if the compiler left it in."""
    member = program.get(uniform, None)
    if isinstance(member, moderngl.Uniform):
        member.write(data)


def source(name: str, **definitions: object) -> str:
    """A shader of this package with these macros defined. The words FRAME_FIELDS and TONE stand for their files."""
    text = (SHADERS / name).read_text(encoding="utf-8")
    for word, file in (("FRAME_FIELDS", "frame.glsl"), ("TONE", "tone.glsl")):
        text = text.replace(word, (SHADERS / file).read_text(encoding="utf-8")) if word in text else text
    macros = "".join(f"#define {word} {value}\n" for word, value in definitions.items())
    return f"#version 330 core\n{macros}{text}"
