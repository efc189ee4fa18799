"""Access to the server: tokens, origins, hosts and paths, with the HTTP client of the standard library."""

from __future__ import annotations

import gzip
import http.client
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from autodrive import AutodriveError, Simulation
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.world import World
from tests.support.native_clients import native_client, raw, scene_files
from tests.support.waiting import LIMIT, free_port, wait_until

SECRET = "nobody may read this"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    (folder / "secret.txt").write_text(SECRET)
    (folder / "page" / "assets").mkdir(parents=True)
    (folder / "page" / "index.html").write_text("<title>page</title>")
    (folder / "page" / "assets" / "index-abc.js").write_text("let x = 1\n" * 500)
    (folder / "page" / "link.txt").symlink_to(folder / "secret.txt")
    return folder / "page"


@pytest.fixture(scope="module")
def still(one_world: World) -> Simulation:
    return Simulation(one_world, is_paused=True)


@pytest.fixture(scope="module")
def server(still: Simulation, page: Path) -> Iterator[SimulationServer]:
    """On this machine alone, without a token."""
    with SimulationServer(
        Served(still, scene_files),
        PageOptions(port=free_port(), allowed_origins=("https://lab.example",)),
        page=page,
    ) as it:
        wait_until(lambda: get(it, "scene/map.glb").status == 200)
        yield it


@pytest.fixture(scope="module")
def locked(still: Simulation, page: Path) -> Iterator[SimulationServer]:
    with SimulationServer(Served(still, scene_files), PageOptions(host="0.0.0.0", port=free_port()), page=page) as it:
        assert it.token is not None
        wait_until(lambda: get(it, f"scene/map.glb?token={it.token}").status == 200)
        yield it


class Answer:
    def __init__(self, response: http.client.HTTPResponse) -> None:
        self.status, self.headers, self.body = response.status, response.headers, response.read()


def get(server: SimulationServer, path: str, method: str = "GET", **headers: str) -> Answer:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=LIMIT)
    connection.putrequest(method, f"/{path}", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    try:
        return Answer(connection.getresponse())
    finally:
        connection.close()


def test_the_page_its_parts_and_the_scene_are_served(server: SimulationServer) -> None:
    assert get(server, "").body == get(server, "index.html").body == b"<title>page</title>"
    assert get(server, "").headers["content-type"] == "text/html; charset=utf-8"
    assert get(server, "").headers["cache-control"] == "no-cache"
    assert get(server, "assets/index-abc.js").headers["content-type"] == "text/javascript; charset=utf-8"
    scene = get(server, "scene/map.glb")
    assert (scene.body, scene.headers["content-type"]) == (b"a map " * 1000, "model/gltf-binary")
    for path in ("assets/index-abc.js", "scene/map.glb"):
        assert "immutable" in get(server, path).headers["cache-control"]


def test_compressible_files_are_compressed_for_browsers_that_accept_it(server: SimulationServer) -> None:
    packed = get(server, "scene/map.glb", Accept_Encoding="gzip, br")
    assert packed.headers["content-encoding"] == "gzip"
    assert gzip.decompress(packed.body) == b"a map " * 1000
    assert len(packed.body) < 200
    assert get(server, "scene/map.glb").headers["content-encoding"] is None


def test_the_page_loads_nothing_from_other_hosts_and_is_embedded_in_allowed_ones_only(server: SimulationServer) -> None:
    headers = get(server, "").headers
    assert "default-src 'self'" in headers["content-security-policy"]
    assert f"connect-src 'self' ws://127.0.0.1:{server.port} wss://" in headers["content-security-policy"]
    ipv6 = get(server, "", Host="[::1]:8730").headers["content-security-policy"]
    assert "connect-src 'self'  blob:" in ipv6  # browsers refuse IPv6 addresses in a policy; 'self' is enough
    assert "frame-ancestors 'self' https://lab.example;" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"


def test_only_reading_is_possible(server: SimulationServer) -> None:
    assert get(server, "", "HEAD").body == b""
    assert get(server, "", "HEAD").status == 200
    assert [get(server, "", method).status for method in ("POST", "PUT", "DELETE")] == [405] * 3


@pytest.mark.parametrize(
    "path",
    [
        "../secret.txt",
        "/../secret.txt",
        "assets/../../secret.txt",
        "..%2fsecret.txt",
        "%2e%2e/secret.txt",
        "%2e%2e%2fsecret.txt",
        "%252e%252e%252fsecret.txt",
        "..\\secret.txt",
        "..%5csecret.txt",
        "assets/..%00/secret.txt",
        "link.txt",
        "scene/../../secret.txt",
        "/etc/passwd",
        "//etc/passwd",
        "%2fetc%2fpasswd",
        "file:///etc/passwd",
        "scene/",
        "assets",
        ".",
        "%ff%fe",
    ],
)
def test_no_file_outside_is_reachable(server: SimulationServer, path: str) -> None:
    answer = get(server, path)
    assert answer.status in {400, 404}
    assert SECRET.encode() not in answer.body
    assert b"root:" not in answer.body


def test_a_foreign_name_for_this_machine_is_refused(server: SimulationServer) -> None:
    """DNS rebinding: the browser believes that evil.example is where we are."""
    for host in ("evil.example", "evil.example:8730", "127.0.0.1.evil.example", "localhost.evil.example", ""):
        assert get(server, "", Host=host).status == 403
    for host in ("localhost:1", "127.0.0.1", "127.8.9.1:80", "[::1]:8730", "page.localhost", "LOCALHOST"):
        assert get(server, "", Host=host).status == 200


def test_pages_of_other_origins_are_refused(server: SimulationServer) -> None:
    here = f"http://127.0.0.1:{server.port}"
    for origin in ("https://evil.example", "http://localhost:1", "http://127.0.0.1:1", "null", f"{here}.evil.example"):
        with pytest.raises(InvalidStatus) as refused, raw(server, origin=origin):
            pass
        assert refused.value.response.status_code == 403
    for origin in (here, "https://lab.example", None):
        with native_client(server, origin=origin) as it:
            assert it.receive()["type"] == "Welcome"


def test_an_allowed_origin_may_also_be_the_host_as_behind_a_proxy(server: SimulationServer) -> None:
    assert get(server, "", Host="lab.example", Origin="https://lab.example").status == 200


def test_other_addresses_need_the_token_of_the_link(locked: SimulationServer) -> None:
    assert locked.url.endswith(f"/?token={locked.token}")
    assert not locked.url.startswith("http://0.0.0.0")
    for path in ("", "index.html", "scene/map.glb", "?token=", "?token=wrong", f"?token={locked.token}x", "?Token=%ff"):
        answer = get(locked, path)
        assert answer.status == 403
        assert b"token" in answer.body
    assert get(locked, f"?token={locked.token}").body == b"<title>page</title>"
    assert get(locked, "assets/index-abc.js").status == 200  # what is public anyway; links in the page have no token
    assert get(locked, "assets/../index.html").status == 404


def test_the_websocket_needs_the_token_too_and_it_is_enough(
    locked: SimulationServer, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(InvalidStatus), raw(locked, query="?token=wrong"):
        pass
    assert not caplog.records  # a refused client is no error
    with native_client(locked, origin="https://anywhere.example") as it:
        assert it.receive()["type"] == "Welcome"


def test_a_websocket_at_another_path_gets_the_right_path(server: SimulationServer) -> None:
    from websockets.sync.client import connect

    with pytest.raises(InvalidStatus) as refused, connect(f"ws://{server.address}/other"):
        pass
    assert refused.value.response.status_code == 404


def test_a_requested_port_that_is_in_use_is_an_error(still: Simulation) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(AutodriveError, match=f"port {port} of 127.0.0.1 is in use"):
            SimulationServer(Served(still, scene_files), PageOptions(port=port)).start()


def test_without_a_requested_port_the_next_free_one_is_used(still: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        monkeypatch.setattr("autodrive.connect.server.server.PORT", other.getsockname()[1])
        with SimulationServer(Served(still, scene_files)) as server:
            assert other.getsockname()[1] < server.port < other.getsockname()[1] + 20
            assert get(server, "").status == 404


def test_an_address_of_another_machine_is_an_error(still: Simulation) -> None:
    with pytest.raises(AutodriveError, match=r"cannot listen on 192\.0\.2\.1 port 8730"):
        SimulationServer(Served(still, scene_files), PageOptions(host="192.0.2.1", port=8730)).start()


def test_it_can_be_closed_and_started_again(still: Simulation, page: Path) -> None:
    server = SimulationServer(Served(still, scene_files), PageOptions(port=free_port()), page=page)
    for _ in range(2):
        with server:
            assert get(server, "").status == 200
            with native_client(server) as it:
                assert it.receive()["type"] == "Welcome"
        with pytest.raises(ConnectionRefusedError):
            get(server, "")
