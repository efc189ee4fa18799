r"""Texts that no encoder accepts: the name of a file that is not UTF-8 reaches Python with lone surrogates.

They are written as escapes everywhere, so that the name of a scenario and the names of its files stay the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import msgspec

_SURROGATE = re.compile("[\ud800-\udfff]")


def encodable(text: str) -> str:
    r"""The text with an escape for each lone surrogate: 'caf\xe9.yaml' for a name with the byte 0xe9."""
    return _SURROGATE.sub(_escape, text)


def total(encode: Callable[[Any], bytes]) -> Callable[[Any], bytes]:
    """The encoder for messages whose texts may have lone surrogates, which it escapes; others cost nothing more."""

    def encoded(message: Any) -> bytes:
        try:
            return encode(message)
        except UnicodeEncodeError:
            return encode(with_encodable_texts(message))

    return encoded


def with_encodable_texts(value: Any) -> Any:
    """The struct, collection or text with all texts in it `encodable`; another value as it is."""
    match value:
        case str():
            return encodable(value)
        case msgspec.Struct():
            fields = {name: with_encodable_texts(getattr(value, name)) for name in value.__struct_fields__}
            return msgspec.structs.replace(value, **fields)
        case dict():
            return {with_encodable_texts(key): with_encodable_texts(inner) for key, inner in value.items()}
        case list() | tuple():
            return [with_encodable_texts(inner) for inner in value]
    return value


def _escape(surrogate: re.Match[str]) -> str:
    """`os.fsdecode` stands for the byte 0xe9 with the code point 0xdce9 (PEP 383)."""
    code = ord(surrogate[0])
    return f"\\x{code - 0xDC00:02x}" if 0xDC80 <= code <= 0xDCFF else f"\\u{code:04x}"
