"""Who may use the viewer: pages that it served itself, on this machine."""

from __future__ import annotations

import http.client
import logging
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from email.message import Message
from urllib.parse import quote, urlsplit

import numpy as np
import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.viewer import Viewer, ViewerOptions, serve
from jacokin.viewer.browser import server
from tests.viewer.page import Page, opened, port_of, until


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with serve(port=0) as running:
        yield running


def address(viewer: Viewer) -> tuple[str, int]:
    return "127.0.0.1", port_of(viewer)


def ask(
    viewer: Viewer,
    origin: str | None,
    host: str | None = None,
    path: str = "/",
    cookie: str | None = None,
    headers: Mapping[str, str] | None = None,
) -> tuple[int, Message]:
    """Status and headers of the answer to a request for a websocket, or for the page where there is no Origin."""
    name, port = address(viewer)
    connection = http.client.HTTPConnection(name, port, timeout=60)
    headers = {"Host": f"{name}:{port}" if host is None else host} | dict(headers or {})
    headers |= {} if cookie is None else {"Cookie": cookie}
    if origin is not None:
        headers |= {
            "Origin": origin,
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version": "13",
        }
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers
    finally:
        connection.close()


def query(viewer: Viewer) -> str:
    return f"?{urlsplit(viewer.url).query}"


def status(viewer: Viewer, origin: str | None, host: str | None = None, path: str = "/") -> int:
    """The status of the answer to who knows the token."""
    return ask(viewer, origin, host, path + query(viewer))[0]


def test_the_page_is_served_to_this_machine_only(viewer: Viewer) -> None:
    assert viewer.url.startswith("http://127.0.0.1:")
    assert status(viewer, None) == 200
    listening = address(viewer)[1]
    outward = [a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)]
    for place in {*outward, "127.0.0.2"} - {"127.0.0.1"}:  # all of 127/8 comes here, but not to one address of it
        with socket.socket() as caller:
            caller.settimeout(5.0)
            assert caller.connect_ex((place, listening)) != 0


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_pages_of_the_viewer_itself_may_use_it(viewer: Viewer, name: str) -> None:
    host = f"{name}:{address(viewer)[1]}"
    assert status(viewer, f"http://{host}", host) == 101
    forwarded = f"{name}:9000"  # another port, as through ssh -L
    assert status(viewer, f"http://{forwarded}", forwarded) == 101


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://127.0.0.1",
        "null",
        "",
        "http://localhost:3000",
        "http://127.0.0.1",
        "file://",
        "http://127.0.0.1.evil.example:8080",
    ],
)
def test_other_pages_may_not(viewer: Viewer, origin: str) -> None:
    assert status(viewer, origin) == 403


@pytest.mark.parametrize("host", ["evil.example:8080", "127.0.0.1.evil.example", "[", ""])
def test_names_that_were_made_to_point_here_are_refused(viewer: Viewer, host: str) -> None:
    assert status(viewer, f"http://{host}", host) == 403
    assert status(viewer, None, host) == 403


def test_a_websocket_of_another_page_does_not_open(viewer: Viewer) -> None:
    before = viewer.view
    with pytest.raises(InvalidStatus, match="403"), opened(viewer, origin="http://evil.example") as page:
        page.move_gizmo((0.3, -0.2, 0.5))
    assert viewer.view is before


@pytest.mark.parametrize("token", ["", "?token=", "?token=wrong", "?token=\xe9"])
def test_without_the_token_there_is_neither_a_page_nor_a_websocket(viewer: Viewer, token: str) -> None:
    own = viewer.url.split("/?")[0]
    path = "/" + quote(token, safe="?=")
    for cookie in (None, "jacokin_viewer=x", f"jacokin_viewer_{port_of(viewer)}=wrong"):
        assert ask(viewer, None, path=path, cookie=cookie)[0] == 403
        assert ask(viewer, own, path=path, cookie=cookie)[0] == 403


FOREIGN = [{"Sec-Fetch-Site": site} for site in ("same-site", "cross-site", "", "SAME-ORIGIN")]


@pytest.mark.parametrize("sent", [*FOREIGN, {}, {"Sec-Fetch-Site": "none"}, FOREIGN[0] | {"X-Jacokin": "hand"}])
@pytest.mark.parametrize("dest", ["image", "empty", "document", None])
def test_what_another_page_of_this_machine_asks_for_moves_nothing(
    viewer: Viewer, sent: dict[str, str], dest: str | None
) -> None:
    """Cookies are shared by all ports, and pictures are asked for without an Origin."""
    told: list[str] = []
    assert isinstance(viewer.server, server.Server)
    viewer.server.listen("/told", told.append)
    cookie = ask(viewer, None, path=f"/{query(viewer)}")[1]["Set-Cookie"].split(";")[0]
    headers = sent | ({} if dest is None else {"Sec-Fetch-Dest": dest})
    assert ask(viewer, None, path="/told?keys=w", cookie=cookie, headers=headers)[0] == 403
    assert told == []
    for own in ({"Sec-Fetch-Site": "same-origin"}, {"X-Jacokin": "hand"}, {"Origin": viewer.url.split("/?")[0]}):
        assert ask(viewer, None, path="/told?keys=w", cookie=cookie, headers=own)[0] == 200
    assert told == ["keys=w"] * 3


@pytest.mark.parametrize("sent", FOREIGN)
def test_the_page_opens_from_a_link_elsewhere_and_as_nothing_else(viewer: Viewer, sent: dict[str, str]) -> None:
    clicked = {**sent, "Sec-Fetch-Dest": "document"}
    assert ask(viewer, None, path=f"/{query(viewer)}", headers=clicked)[0] == 200
    for dest in ("image", "script", "iframe", "empty", "websocket"):
        assert ask(viewer, None, path=f"/{query(viewer)}", headers={**sent, "Sec-Fetch-Dest": dest})[0] == 403
    own = viewer.url.split("/?")[0]
    assert ask(viewer, own, path=f"/{query(viewer)}", headers={"Sec-Fetch-Site": "same-site"})[0] == 403
    assert ask(viewer, own, path=f"/{query(viewer)}", headers={"Sec-Fetch-Site": "same-origin"})[0] == 101


ADDRESSES = [
    b"/\xff", b"//[", b"/[", b"//[x]", b"http://[/", b"/%00", b"/%ff", b"/%", b"/a\xff?token=\xff", b"?", b"*", b"//",
    b"/" + b"a" * 3000, b"/..", b"/%2e%2e%2f" * 9, b"/\\", b"/?token=%ff", b"/hand?keys=\xff", b"//[/hand?keys=w",
    b"/;", b"/#", b"[", b"\xff",
]  # fmt: skip


@pytest.mark.parametrize("known", [False, True], ids=["stranger", "page"])
@pytest.mark.parametrize("address_asked", ADDRESSES)
def test_no_address_is_an_error_of_the_viewer(viewer: Viewer, address_asked: bytes, known: bool) -> None:
    cookie = ask(viewer, None, path=f"/{query(viewer)}")[1]["Set-Cookie"].split(";")[0]
    with socket.create_connection(address(viewer), timeout=30.0) as caller:
        lines = [b"GET " + address_asked + b" HTTP/1.1", b"Host: 127.0.0.1:%d" % port_of(viewer), b"Connection: close"]
        lines += [b"Cookie: " + cookie.encode()] if known else []
        caller.sendall(b"\r\n".join([*lines, b"", b""]))
        answer = caller.recv(4096).split(b"\r\n")[0]
    assert answer.split()[1] in ((b"200", b"400", b"404") if known else (b"400", b"403")), answer


@pytest.mark.parametrize(
    "name", ["Host", "Origin", "Cookie", "Sec-Fetch-Site", "Sec-Fetch-Dest", "Connection", "Upgrade"]
)
def test_no_header_is_an_error_of_the_viewer(viewer: Viewer, name: str) -> None:
    for value in (b"\xff", b"[", b"", b"\xc3\xa9", b"a" * 3000, b"%d" % 10**30, b"; ;=;", b"upgrade"):
        for times in (1, 2):
            lines = [f"GET /{query(viewer)} HTTP/1.1".encode(), *[name.encode() + b": " + value] * times]
            lines += [] if name == "Host" else [b"Host: 127.0.0.1:%d" % port_of(viewer)]
            with socket.create_connection(address(viewer), timeout=30.0) as caller:
                caller.sendall(b"\r\n".join([*lines, b"", b""]))
                answer = caller.recv(4096).split(b"\r\n")[0]
            assert answer.split()[1] in (b"200", b"400", b"403", b"426"), (value, times, answer)


def test_the_page_brings_the_token_back_as_a_cookie(viewer: Viewer) -> None:
    found, headers = ask(viewer, None, path=f"/{query(viewer)}")
    assert found == 200
    cookie, *attributes = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict"} <= set(attributes)
    own = viewer.url.split("/?")[0]
    assert ask(viewer, own, cookie=f"theme=dark; {cookie}")[0] == 101
    assert ask(viewer, None, cookie=cookie)[0] == 200
    assert ask(viewer, "http://evil.example", cookie=cookie)[0] == 403


def test_every_viewer_has_a_token_of_its_own(viewer: Viewer, robot: Robot) -> None:
    with serve(robot, port=0) as other:
        assert query(other) != query(viewer)
        assert ask(other, None, path=f"/{query(viewer)}")[0] == 403


def test_no_page_may_show_the_viewer_in_a_frame(viewer: Viewer) -> None:
    for path in (f"/{query(viewer)}", "/"):
        _, headers = ask(viewer, None, path=path)
        assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["Referrer-Policy"] == "no-referrer"


def test_a_program_without_a_page_may_connect(viewer: Viewer) -> None:
    kind = f"viser-v{viser.__version__}"
    with connect(viewer.url.replace("http", "ws"), subprotocols=[kind]) as connection:  # type: ignore[list-item]  # a NewType of str
        assert connection.subprotocol == kind


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/%2e%2e/pyproject.toml", "//etc/passwd", "/..%5c..%5cx", "/etc/passwd"]
)
def test_no_file_but_the_page_is_served(viewer: Viewer, path: str) -> None:
    assert status(viewer, None, path=path) == 404


def test_a_client_cannot_ask_for_a_public_address(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from viser import _tunnel

    tunnels: list[object] = []
    monkeypatch.setattr(_tunnel.ViserTunnel, "__init__", lambda *given: tunnels.append(given))
    with caplog.at_level(logging.WARNING), opened(viewer) as page:
        page.send("ShareUrlRequest")
        assert until(lambda: "public address" in caplog.text)
    assert not tunnels
    assert viewer.server.request_share_url() is None


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["silent", "unread"])
def test_closing_does_not_wait_for_who_does_not_answer(robot: Robot, kind: str) -> None:
    """Neither for a connection that asks for nothing, nor for a page that does not read what it is sent."""
    with serve(robot, port=0) as viewer, socket.create_connection(address(viewer)) as caller:
        if kind == "unread":
            name = f"127.0.0.1:{port_of(viewer)}"
            lines = [
                f"GET /{query(viewer)} HTTP/1.1",
                f"Host: {name}",
                f"Origin: http://{name}",
                "Upgrade: websocket",
                "Connection: Upgrade",
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                "Sec-WebSocket-Version: 13",
                f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
            ]
            points = np.zeros((2_000_000, 3), dtype=np.float32)  # more than the system keeps for a slow reader
            viewer.server.scene.add_point_cloud("/points", points, colors=(0, 0, 0))
            caller.sendall("\r\n".join([*lines, "", ""]).encode())
            assert caller.recv(1_000_000, socket.MSG_WAITALL).startswith(b"HTTP/1.1 101")
        began = time.monotonic()
        viewer.close()
        assert time.monotonic() - began < 9.0  # a connection by itself waits 10 s for its reader


def test_a_message_of_wrong_types_is_one_line(robot: Robot, caplog: pytest.LogCaptureFixture) -> None:
    def changed(page: Page, **updates: object) -> None:
        page.send("GuiUpdateMessage", uuid=page.control("joint_1").uuid, updates=updates)

    with caplog.at_level(logging.WARNING), serve(robot, port=0) as viewer, opened(viewer) as page:
        asked: list[Callable[[], object]] = [
            lambda: page.move_gizmo("left", "right"),
            lambda: page.move_gizmo(None, None),
            lambda: page.move_gizmo((0.3, 0.0)),
            lambda: page.change("Branch", "first"),
            lambda: page.change("Tool [m]", ("a", "b", "c")),
            lambda: changed(page, value="left"),
            lambda: changed(page, removed=True),
            lambda: page.send("GuiUpdateMessage", uuid=[1], updates=5),
            lambda: page._socket.send("words"),
            lambda: page._socket.send(b"\xff\xff"),
        ]
        for number, send in enumerate(asked):
            send()
            assert until(lambda number=number: len(caplog.records) > number)  # type: ignore[misc]  # bound here
        page.move_gizmo((0.3, -0.2, 0.5))  # the page still has its connection
        assert until(lambda: viewer.view.target.translation[1] == -0.2)
    assert len(caplog.records) == len(asked)
    for record in caplog.records:
        assert "ignored a message of a page: " in record.getMessage()
        assert not record.exc_info
        assert "\n" not in record.getMessage()


def test_another_host_warns(caplog: pytest.LogCaptureFixture, robot: Robot) -> None:
    with caplog.at_level(logging.WARNING), serve(robot, ViewerOptions(host="0.0.0.0"), port=0) as viewer:
        assert "every computer" in caplog.text
        assert viewer.url.startswith("http://127.0.0.1:")
        assert status(viewer, viewer.url.split("/?")[0]) == 101
        assert status(viewer, "http://evil.example") == 403


def test_a_port_in_use_is_named(viewer: Viewer, robot: Robot) -> None:
    port = address(viewer)[1]
    with pytest.raises(InvalidInputError, match=f"port {port} of 127.0.0.1 cannot be used .*or 0 for any free one"):
        serve(robot, port=port)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("host", "port", "message"),
    [
        ("127.0.0.1", 70000, "port must be from 0 to 65535, got 70000"),
        ("127.0.0.1", -1, "port"),
        ("no such host", 0, "host 'no such host' is not known"),
        ("", 0, "host must be a name or an address"),
        ("192.0.2.1", 0, "cannot be used"),
    ],
)
def test_a_wrong_host_or_port_is_refused(robot: Robot, host: str, port: int, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        serve(robot, ViewerOptions(host=host), port=port)


def test_servers_of_others_are_not_guarded() -> None:
    import websockets.asyncio.server

    before = websockets.asyncio.server.serve
    running, _ = server.start("127.0.0.1", 0, "guarded")
    running.stop()
    assert websockets.asyncio.server.serve is before
