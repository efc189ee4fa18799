"""Copies and pickles of environments: other ones that are made with the same arguments."""

from __future__ import annotations

from typing import Any, Self


class Remade:
    """Base of an environment whose copy, also in another process, is a new one of the same settings and conditions.

    A copy begins with a reset: worlds, random numbers and the page of an environment are not copied.
    """

    _made_with: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *arguments: Any, **settings: Any) -> Self:
        """Keep the arguments of the constructor."""
        made = super().__new__(cls)
        made._made_with = arguments, settings
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        kept = {name: getattr(self, name) for name in ("spec", "conditions") if getattr(self, name, None) is not None}
        return _made, (type(self), *self._made_with), kept

    def __setstate__(self, kept: dict[str, Any]) -> None:
        for name, value in kept.items():
            setattr(self, name, value)


def _made(kind: type[Remade], arguments: tuple[Any, ...], settings: dict[str, Any]) -> Remade:
    return kind(*arguments, **settings)
