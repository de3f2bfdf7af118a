"""The web server: viser's, on a socket of our own, for pages that it served itself and no others.

Viser binds all interfaces, takes the next port when one is in use, accepts websocket connections from any page, and
opens a tunnel to a public address when a client asks for it. Here the socket is bound before viser starts, each request
is checked by its Host and Origin before viser sees it, and there is no tunnel.
"""

from __future__ import annotations

import http
import ipaddress
import logging
import os
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Protocol
from urllib.parse import urlsplit

import rich
import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from jacokin.errors import InvalidInputError, JacokinError
from jacokin.model import checks

LOOPBACK = "127.0.0.1"
LAST_PORT = 65535

logger = logging.getLogger(__name__)
unheard = logging.getLogger(f"{__name__}.websockets")  # it logs each connection that a browser opens and does not use
unheard.setLevel(logging.CRITICAL + 1)
_starting = threading.Lock()

Answer = Response | None
Check = Callable[[ServerConnection, Request], Answer | Awaitable[Answer]]


class _Serve(Protocol):
    def __call__(self, handler: Callable[..., object], *args: object, **options: object) -> object: ...


class Server(viser.ViserServer):
    """Viser's server, which gives no public address."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse: a client may ask for this, and the viewer is for this machine."""
        logger.warning("a page asked for a public address, which the viewer does not give")
        return None

    def stop(self) -> None:
        """Stop serving and disconnect every page, without a message."""
        with quiet():
            super().stop()


def start(host: str, port: int, label: str) -> tuple[Server, str]:
    """Start serving.

    Args:
        host: address or name of the interface.
        port: 0 for any free one.
        label: of the panel.

    Returns:
        The server, and the address of its page.

    Raises:
        InvalidInputError: the host does not exist here, or the port is in use or not one.
        JacokinError: the installed viser does not start in the way that the checks rely on.
    """
    listening = bind(host, port)
    address, bound = listening.getsockname()[:2]
    guard = _Guard(listening, OwnPages(host))
    try:
        with _starting, quiet():
            genuine = websockets.asyncio.server.serve
            websockets.asyncio.server.serve = guard.over(genuine)  # type: ignore[assignment,misc]  # viser has no hook for it
            try:
                server = Server(host=LOOPBACK, port=bound, label=label, verbose=False)
            finally:
                websockets.asyncio.server.serve = genuine  # type: ignore[misc]  # as above
    except BaseException:
        listening.close()
        raise
    if not guard.used:
        server.stop()
        listening.close()
        raise JacokinError(f"viser {viser.__version__} cannot be guarded against other pages; install another version")
    if not ipaddress.ip_address(address).is_loopback:
        logger.warning("the viewer is open to every computer that reaches %s:%d, without a password", address, bound)
    name = LOOPBACK if ipaddress.ip_address(address).is_unspecified else address
    return server, f"http://[{name}]:{bound}" if ":" in name else f"http://{name}:{bound}"


def bind(host: str, port: int) -> socket.socket:
    """A listening socket.

    Raises:
        InvalidInputError: no such host here; the port is in use, not allowed or not one.
    """
    number = checks.whole_number("port", port)
    if number > LAST_PORT:
        raise InvalidInputError(f"port must be from 0 to {LAST_PORT}, got {number}")
    if not isinstance(host, str) or not host:
        raise InvalidInputError(f"host must be a name or an address, got {checks.shown(host)}")
    try:
        found = socket.getaddrinfo(host, number, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise InvalidInputError(f"host {host!r} is not known: {error}") from error
    family, _, _, _, address = found[0]
    try:
        return socket.create_server(address[:2], family=family, backlog=128)
    except OSError as error:
        raise InvalidInputError(
            f"port {number} of {host} cannot be used ({os.strerror(error.errno or 0)}); choose another, "
            "or 0 for any free one"
        ) from error


class OwnPages:
    """Tells requests of the viewer's own page from those of other pages.

    A browser names the page in Origin, and in Host the name that it looked the server up by. A foreign page has another
    Origin; one whose name was made to point here (DNS rebinding) has its own name in Host, which is not one of ours.
    A program that is not a browser sends no Origin.
    """

    def __init__(self, host: str) -> None:
        """Collect the names of this machine; an address always passes, since no page can have it looked up."""
        self._names = {"localhost", host.lower(), socket.gethostname().lower()}

    def refusal(self, headers: Headers) -> str | None:
        """Why a request is refused; None when it is not."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return "one Host and at most one Origin are expected"
        if not self._own_name(hosts[0]):
            return f"{hosts[0]!r} is not a name of the viewer"
        if origins and origins[0].lower() != f"http://{hosts[0].lower()}":
            return f"pages of {origins[0]!r} may not use the viewer"
        return None

    def _own_name(self, host: str) -> bool:
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        return True


class _Guard:
    """Makes the server that viser starts use our socket and our check."""

    def __init__(self, listening: socket.socket, pages: OwnPages) -> None:
        self._listening = listening
        self._pages = pages
        self.used = False

    def over(self, genuine: type[websockets.asyncio.server.serve]) -> _Serve:
        """What stands in for `websockets.asyncio.server.serve` while viser starts."""

        def serve(handler: Callable[..., object], *args: object, **options: object) -> object:
            if not (getattr(handler, "__module__", None) or "").startswith("viser."):
                return genuine(handler, *args, **options)  # type: ignore[arg-type]  # of another server: passed on
            self.used = True
            options["process_request"] = self._checked(options.get("process_request"))  # type: ignore[arg-type]  # viser's
            options["logger"] = unheard
            return genuine(handler, sock=self._listening, **options)  # type: ignore[arg-type]  # viser's options

        return serve

    def _checked(self, inner: Check | None) -> Check:
        def check(connection: ServerConnection, request: Request) -> Answer | Awaitable[Answer]:
            refusal = self._pages.refusal(request.headers)
            if refusal is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{refusal}\n")
            return None if inner is None else inner(connection, request)

        return check


@contextmanager
def quiet() -> Iterator[None]:
    """Without viser's messages on stdout."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
