"""The table of signals in docs/protocol.md, from the registry; `python -m tests.support.signal_table` writes it."""

from __future__ import annotations

from pathlib import Path

from autodrive.protocol.channels import CHANNELS, Signal
from tests.support.tables import rewritten

DOCUMENT = Path(__file__).parents[2] / "docs" / "protocol.md"


def rows() -> list[str]:
    """The lines of the table."""
    lines = ["| signal | type | unit | frame | rate | what |", "|---|---|---|---|---|---|"]
    for channel in CHANNELS:
        rate = f"`{channel.rate}`" if channel.rate else "each Frame"
        for signal in channel.signals:
            unit, frame = signal.unit, f"`{signal.frame}`" if signal.frame else ""
            lines.append(f"| `{signal.name}` | {_type(signal)} | {unit} | {frame} | {rate} | {signal.text} |")
    return lines


def _type(signal: Signal) -> str:
    shape = ", ".join(map(str, signal.shape))
    return f"{signal.dtype}[{shape}]" if shape else str(signal.dtype)


if __name__ == "__main__":
    DOCUMENT.write_text(rewritten(DOCUMENT.read_text(encoding="utf-8"), {"signals": rows()}), encoding="utf-8")
