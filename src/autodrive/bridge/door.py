"""Who may come in: a right token, or else a browser or script of this machine that no other site has sent."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

NEEDS_TOKEN = "this simulator needs its token: open the link that it printed when it started"


@dataclass(frozen=True)
class Door:
    """Judges requests. Where there is a `token`, it decides alone.

    Without one, `Host` must name this machine, so that no foreign name that was made to point here (DNS rebinding) is
    served, and `Origin`, which browsers send, must be the same or one of `allowed_origins`.
    """

    token: str | None = None
    allowed_origins: Sequence[str] = ()

    def refusal(self, headers: dict[bytes, bytes], query: bytes) -> str:
        """Why that request is refused; empty if it is not. Names of `headers` are in lower case."""
        if self.token is not None:
            return "" if self._is_right(query) else NEEDS_TOKEN
        host = headers.get(b"host", b"").decode("latin-1").lower()
        if not is_loopback(_name(host)) and host not in self._allowed_hosts:
            return f"the host '{host}' is not this machine: use http://127.0.0.1, or start with a token or an origin"
        origin = headers.get(b"origin", b"").decode("latin-1").lower()
        if origin and urlsplit(origin).netloc != host and origin not in self._allowed:
            return f"pages of the origin '{origin}' are not allowed; it can be named with --allow-origin"
        return ""

    @property
    def _allowed(self) -> set[str]:
        return {origin.lower().rstrip("/") for origin in self.allowed_origins}

    @property
    def _allowed_hosts(self) -> set[str]:
        return {urlsplit(origin).netloc for origin in self._allowed}

    def _is_right(self, query: bytes) -> bool:
        """Compared in constant time."""
        assert self.token is not None
        given = parse_qs(query.decode("latin-1")).get("token", [""])[0]
        return hmac.compare_digest(given.encode(), self.token.encode())


def is_loopback(host: str) -> bool:
    """Whether a name or address can only mean this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _name(host: str) -> str:
    """Of a Host header, without port and brackets."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.rpartition(":")[0] or host
