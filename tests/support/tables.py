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


def cells(text: str, head: str) -> dict[str, list[str]]:
    """The rows of the table whose head begins with that text: the first cell of a row, and the cells after it."""
    table = text[text.index(head) :].split("\n\n", maxsplit=1)[0].splitlines()[2:]
    rows = [[cell.strip() for cell in row.strip("| ").split("|")] for row in table]
    return {first: others for first, *others in rows}
