"""Tables in documents that are generated from the code."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping


def rewritten(text: str, tables: Mapping[str, Iterable[str]]) -> str:
    """A document with these rows instead of those after the mark of each table."""
    for name, rows in tables.items():
        pattern = rf"(<!-- {name}: generated.* -->\n)(?:\|.*\n)*"
        assert re.search(pattern, text), f"the document has no table '{name}'"
        text = re.sub(pattern, lambda found, rows=rows: found[1] + "\n".join(rows) + "\n", text)
    return text
