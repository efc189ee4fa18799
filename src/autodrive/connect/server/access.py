"""Access policy: a valid token, or a same-origin client on this machine."""

from __future__ import annotations

import hmac
import ipaddress
import re
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from autodrive.base.errors import AutodriveError

LEAST_TOKEN = 16
"""Least length of a token that a user chooses [characters]."""

_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:\d{1,5})?", re.IGNORECASE)
_ORIGIN = re.compile(rf"[a-z][a-z0-9+.-]*://({_HOST.pattern})", re.IGNORECASE)

NEEDS_TOKEN = "this simulator needs its token: open the link that it printed when it started"


@dataclass(frozen=True)
class AccessPolicy:
    """Decides which requests are allowed. If there is a `token`, only the token counts.

    Without a token, `Host` must name this machine, which prevents DNS rebinding, and `Origin`, which browsers send,
    must be the same origin or one of `allowed_origins`.
    """

    token: str | None = None
    allowed_origins: Sequence[str] = ()

    def refusal(self, headers: dict[bytes, bytes], query: bytes) -> str:
        """Why a request is refused; empty if it is allowed. The names of `headers` are in lower case."""
        if self.token is not None:
            return "" if self._has_token(query) else NEEDS_TOKEN
        host = headers.get(b"host", b"").decode("latin-1").lower()
        is_here = is_host(host) and is_loopback(_name(host))
        if not is_here and host not in self._allowed_hosts:
            return f"the host '{host[:100]}' is not this machine: use http://127.0.0.1, --token or --allow-origin"
        origin = headers.get(b"origin", b"").decode("latin-1").lower()
        parts = _ORIGIN.fullmatch(origin)
        if origin and (parts is None or parts[1] != host) and origin not in self._allowed:
            return f"pages of the origin '{origin[:100]}' are not allowed; --allow-origin allows it"
        return ""

    @property
    def _allowed(self) -> set[str]:
        return {origin.lower().rstrip("/") for origin in self.allowed_origins}

    @property
    def _allowed_hosts(self) -> set[str]:
        return {urlsplit(origin).netloc for origin in self._allowed}

    def _has_token(self, query: bytes) -> bool:
        """Whether the query holds the token, compared in constant time."""
        assert self.token is not None
        token = parse_qs(query.decode("latin-1")).get("token", [""])[0]
        return hmac.compare_digest(token.encode(), self.token.encode())


def checked_token(token: str) -> str:
    """The token. Raises `AutodriveError` if it can be guessed or does not fit into a link."""
    if len(token) < LEAST_TOKEN or not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise AutodriveError(
            f"a token has {LEAST_TOKEN} or more characters, letters, digits and '-._~'; without --token, a token is "
            "generated"
        )
    return token


def is_host(text: str) -> bool:
    """Whether a text is a host name or address, with or without a port, as in a Host header."""
    return _HOST.fullmatch(text) is not None


def is_loopback(host: str) -> bool:
    """Whether a name or address always means this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _name(host: str) -> str:
    """The name in a Host header, without port and brackets."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.rpartition(":")[0] or host
