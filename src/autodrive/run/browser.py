"""Opens the page in a local browser, or gives the ssh command with which to reach it."""

from __future__ import annotations

import getpass
import os
import socket
import sys
import threading
import webbrowser
from urllib.parse import urlsplit

from autodrive.base.tcp import address_text
from autodrive.connect.server.access import is_loopback
from autodrive.protocol.ports import PORT


def has_screen() -> bool:
    """Whether this session has a display on this machine."""
    if "SSH_CONNECTION" in os.environ:
        return False
    return sys.platform in {"darwin", "win32"} or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_page(link: str) -> bool:
    """Open the link in the background; False if there is no browser, or only one that runs in the terminal."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if type(browser) is webbrowser.GenericBrowser:  # a text browser such as lynx
        return False
    threading.Thread(target=browser.open, args=(link,), name="autodrive-browser", daemon=True).start()
    return True


def tunnel(link: str) -> str:
    """The ssh command that forwards the port of the page to the user's machine; empty outside an ssh session."""
    address = urlsplit(link)
    host = address.hostname or ""
    if "SSH_CONNECTION" not in os.environ or not is_loopback(host):
        return ""
    server_address = os.environ["SSH_CONNECTION"].split()[2] or socket.gethostname()
    page = address_text(host, address.port or PORT)
    return f"ssh -N -L {address.port}:{page} {_user()}@{server_address}"


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # in a container the user id may have no name
        return "USER"
