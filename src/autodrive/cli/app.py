"""The application `autodrive`: registers the commands and turns errors into exit codes.

Modules of commands import only what the help needs; a command imports the rest when it runs.
"""

from __future__ import annotations

import errno
import os
import re
import signal
import sys
from typing import Annotated, Any

import typer

from autodrive.base.errors import AutodriveError
from autodrive.base.version import __version__
from autodrive.cli import browse, recordings, tracks
from autodrive.cli.campaign import CampaignCommand, campaign
from autodrive.cli.doctor import doctor
from autodrive.cli.film import film
from autodrive.cli.identify import identify
from autodrive.cli.new import new
from autodrive.cli.play import play
from autodrive.cli.race import race
from autodrive.cli.replay import replay
from autodrive.cli.run import run, run_default
from autodrive.cli.urdf import urdf
from autodrive.cli.weather import weather

app = typer.Typer(name="autodrive", add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False)


DISK_ERRORS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}


def main(interrupt: Any = None) -> None:
    """Run the command. Errors that a user can fix print one line to stderr; the exit code is 2.

    `interrupt`: the handler of Ctrl-C from now on; None: as it is.
    """
    try:
        if interrupt is not None:
            signal.signal(signal.SIGINT, interrupt)
        code = app(standalone_mode=False)
        sys.stdout.flush()
    except AutodriveError as error:
        code = _fail(str(error))
    except typer.exceptions.TyperException as error:
        code = _fail(_usage(error))
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except BrokenPipeError:  # the reader of our output has exited
        sys.stderr.close()
        code = 141
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
app.command("list")(browse.list_)
app.command()(browse.show)
app.command()(browse.check)
app.command()(new)
app.command()(urdf)
app.command()(weather)
app.command()(doctor)
app.command()(replay)
app.command()(film)
app.add_typer(tracks.importing, name="import")
app.command()(recordings.plot)
app.command()(recordings.compare)
app.command()(identify)
tracks.exporting.command("recording")(recordings.export)
app.add_typer(tracks.exporting, name="export", cls=recordings.ExportGroup)
app.add_typer(tracks.generating, name="generate")


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
