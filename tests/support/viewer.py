"""A viewer of a real server, as the page is one."""

from __future__ import annotations

from autodrive.connect.client.client_socket import Address, ClientSocket
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import Frame
from autodrive.protocol.native import PROTOCOL, Drawn, Hello, Subscribe
from tests.support.waiting import LIMIT, wait_until


class Viewer:
    """A page: it keeps what is drawn."""

    def __init__(self, address: str, *, drawings: bool = True) -> None:
        self.socket = ClientSocket(Address.of(address), LIMIT)
        self.socket.send(encode(Hello(PROTOCOL, "viewer")), encode(Subscribe(frame_rate=60.0, drawings=drawings)))
        self.drawings: dict[str, Drawn] = {}
        self.frames = 0

    def receive(self) -> None:
        """Read what has come."""
        for data in self.socket.receive(0.05):
            match decode_server(data):
                case Drawn(name=name, drawing=None):
                    del self.drawings[name]
                case Drawn(name=name) as drawn:
                    self.drawings[name] = drawn
                case Frame():
                    self.frames += 1
                case _:
                    pass

    def wait_for(self, *names: str) -> dict[str, Drawn]:
        """The drawings, once they have these names."""

        def is_there() -> bool:
            self.receive()
            return set(self.drawings) == set(names)

        wait_until(is_there)
        return self.drawings
