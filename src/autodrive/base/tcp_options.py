"""TCP options that the server and the devkit bridge set on their connections."""

from __future__ import annotations

import socket


def drop_dead_peer(tcp: socket.socket, timeout: float) -> None:
    """Close a connection whose peer has acknowledged nothing for `timeout` [s] (on Linux; elsewhere: keep-alive)."""
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(1e3 * timeout))
