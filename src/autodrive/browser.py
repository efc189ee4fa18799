"""Opens the page in the browser of whoever sits here, and tells who does not how to reach it."""

from __future__ import annotations

import getpass
import os
import socket
import sys
import threading
import webbrowser
from urllib.parse import urlsplit


def has_screen() -> bool:
    """Whether somebody sits before a screen of this very machine."""
    if "SSH_CONNECTION" in os.environ:
        return False
    return sys.platform in {"darwin", "win32"} or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_page(link: str) -> bool:
    """Open the link without waiting; False if there is no browser, or only one that would take over the terminal."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if type(browser) is webbrowser.GenericBrowser:  # lynx and its like
        return False
    threading.Thread(target=browser.open, args=(link,), name="autodrive-browser", daemon=True).start()
    return True


def tunnel(link: str) -> str:
    """The line that brings the page to the machine from which somebody is logged in here with ssh; else empty."""
    address = urlsplit(link)
    if "SSH_CONNECTION" not in os.environ or address.hostname not in {"127.0.0.1", "localhost"}:
        return ""
    here = os.environ["SSH_CONNECTION"].split()[2]
    return f"ssh -N -L {address.port}:127.0.0.1:{address.port} {_user()}@{here or socket.gethostname()}"


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container may run as nobody that has a name
        return "USER"
