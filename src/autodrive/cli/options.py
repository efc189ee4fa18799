"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import typer

from autodrive.protocol.ports import PORT

Host: TypeAlias = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Address on which to serve the page; 0.0.0.0: all interfaces.")
]
Port: TypeAlias = Annotated[
    int | None,
    typer.Option(min=0, max=65535, help=f"Port of the page.  [default: {PORT}, or the next free port]"),
]
Token: TypeAlias = Annotated[
    str | None,
    typer.Option(help="Access token.  [default: generated if --host lets other machines connect]"),
]
Browser: TypeAlias = Annotated[
    bool, typer.Option("--browser/--no-browser", help="Open the page in the browser if there is a display.")
]
