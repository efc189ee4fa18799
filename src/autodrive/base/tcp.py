"""TCP: addresses as texts, sockets that listen, and options of connections."""

from __future__ import annotations

import ipaddress
import socket


def address_text(host: str, port: int) -> str:
    """'host:port', with the brackets of an IPv6 address: '[::1]:8730'."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def without_brackets(host: str) -> str:
    """A host name or address; an IPv6 address may have the brackets of a link: '[::1]'."""
    return host[1:-1] if host.startswith("[") and host.endswith("]") else host


def is_every_interface(host: str) -> bool:
    """Whether a host means all interfaces of this machine: '', '0.0.0.0' or '::'."""
    try:
        return host == "" or ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def listener(host: str, port: int) -> socket.socket:
    """A socket that listens at an IPv4 or IPv6 address, or at that of a name; '::' takes both. Raises `OSError`."""
    addresses = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    families = {family for family, *_ in addresses}
    family = socket.AF_INET if socket.AF_INET in families else socket.AF_INET6
    takes_both = family == socket.AF_INET6 and is_every_interface(host) and socket.has_dualstack_ipv6()
    return socket.create_server((host, port), family=family, backlog=200, dualstack_ipv6=takes_both)


def drop_dead_peer(tcp: socket.socket, timeout: float) -> None:
    """Close a connection whose peer has acknowledged nothing for `timeout` [s] (on Linux; elsewhere: keep-alive)."""
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(1e3 * timeout))
