"""The application `autodrive`: registers the commands and turns errors into exit codes.

Modules of commands import only what the help needs; a command imports the rest when it runs.
"""

from __future__ import annotations

import ast
import contextlib
import errno
import inspect
import io
import os
import re
import signal
import sys
from typing import Annotated, Any

import typer

from autodrive.base.errors import AutodriveError
from autodrive.base.texts import encodable
from autodrive.base.version import __version__
from autodrive.cli import browse, recordings, tracks
from autodrive.cli.campaign import CampaignCommand, campaign
from autodrive.cli.compiled import compile_
from autodrive.cli.deploy import deploy
from autodrive.cli.doctor import doctor
from autodrive.cli.film import film
from autodrive.cli.identify import identify
from autodrive.cli.new import new
from autodrive.cli.parity import parity
from autodrive.cli.play import play
from autodrive.cli.race import race
from autodrive.cli.replay import replay
from autodrive.cli.run import run, run_default
from autodrive.cli.stopping import interruptible
from autodrive.cli.twin import twin
from autodrive.cli.urdf import urdf
from autodrive.cli.weather import weather

app = typer.Typer(name="autodrive", add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False)


DISK_ERRORS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}


def main(interrupt: Any = None) -> None:
    """Run the command. Errors that a user can fix print one line to stderr; the exit code is 2.

    `interrupt`: the handler of Ctrl-C from now on; None: as it is.
    """
    sys.stdout, sys.stderr = _lasting(sys.stdout), _lasting(sys.stderr)
    if sys.flags.optimize > 1:
        _restore_help(app)
    try:
        if interrupt is not None:
            signal.signal(signal.SIGINT, interrupt)
        with interruptible():
            code = app(standalone_mode=False)
        sys.stdout.flush()
    except AutodriveError as error:
        code = _fail(str(error))
    except typer.exceptions.TyperException as error:
        code = _fail(_usage(error))
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except UnicodeEncodeError as error:  # of a library, such as the writer of Parquet files
        code = _fail(f"'{encodable(error.object)}' is not a text in UTF-8, which this command needs: rename the file")
    except OSError as error:
        if error.errno not in DISK_ERRORS:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Python writes what is left at its end
        code = _fail(f"cannot write: {error.strerror}" + (f"  ({error.filename})" if error.filename else ""))
    sys.exit(code if isinstance(code, int) else 0)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Simulate scaled autonomous vehicles and connect them to your driving scripts.

    Without a command: `autodrive run`, the default scenario with its page in the browser.
    """
    if version:
        typer.echo(f"autodrive {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        run_default()


app.command()(run)
app.command()(race)
app.command(cls=CampaignCommand)(campaign)
app.command()(play)
app.command()(deploy)
app.command()(parity)
app.command("list")(browse.list_)
app.command()(browse.show)
app.command()(browse.check)
app.command()(new)
app.command()(urdf)
app.command()(weather)
app.command()(doctor)
app.command("compile")(compile_)
app.command()(replay)
app.command()(film)
app.add_typer(tracks.importing, name="import")
app.command()(recordings.plot)
app.command()(recordings.compare)
app.command()(identify)
app.command()(twin)
tracks.exporting.command("recording")(recordings.export)
app.add_typer(tracks.exporting, name="export", cls=recordings.ExportGroup)
app.add_typer(tracks.generating, name="generate")


def _restore_help(app: typer.Typer) -> None:
    """Read the texts of the help from the source: `python -OO` has removed the docstrings, which contain them."""
    for command in (*app.registered_commands, app.registered_callback):
        if command is not None and command.callback is not None:
            with contextlib.suppress(OSError):  # the source is not installed
                (definition,) = ast.parse(inspect.getsource(command.callback)).body
                command.help = ast.get_docstring(definition)  # pyright: ignore[reportArgumentType]
    for group in app.registered_groups:
        if group.typer_instance is not None:
            _restore_help(group.typer_instance)


class LastingStream:
    """Discards what is written after the reader has ended, as in `autodrive run | head -1`: the command goes on.

    Characters that the encoding does not have, and names that are not UTF-8, are written as escapes.
    """

    def __init__(self, stream: io.TextIOWrapper) -> None:
        self._stream = stream
        if stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write to the stream; a text of which it cannot encode each character is escaped."""
        try:
            return self._stream.write(encodable(text) if self._stream.errors == "backslashreplace" else text)
        except BrokenPipeError:
            self._discard()
            return len(text)

    def flush(self) -> None:
        """Flush the stream."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._discard()

    def _discard(self) -> None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


def _lasting(stream: Any) -> Any:
    return LastingStream(stream) if isinstance(stream, io.TextIOWrapper) else stream


def _usage(error: Any) -> str:
    """An error in the command line, as one line."""
    text = error.format_message() if hasattr(error, "format_message") else str(error)
    text = " ".join(text.split()).replace("Value error, ", "").replace("valid integer", "whole number")
    text = re.sub(r"Input should be (a )?(valid )?([^,(]*)(, unable to parse[^(]*)?", r"must be \1\3", text)
    text = re.sub("must be a number$", "must be a number such as 0.5", text)
    return f"{text}  (see: autodrive --help)"


def _fail(text: str) -> int:
    typer.echo(f"autodrive: {text}", err=True)
    return 2
