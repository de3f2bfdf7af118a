"""The web server: viser's, on a socket of our own, for pages that it served itself and no others.

Viser binds all interfaces, takes the next port when one is in use, accepts websocket connections from any page and any
user, and opens a tunnel to a public address when a client asks for it. Here the socket is bound before viser starts,
each request is checked by its Host, Origin and token before viser sees it, and there is no tunnel.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import inspect
import ipaddress
import logging
import os
import secrets
import socket
import threading
import weakref
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal, Protocol
from urllib.parse import parse_qs, urlsplit

import msgspec
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
PATIENCE = 0.5  # [s] that pages are given to close their connection, once the viewer ends
OWN_SITES = ["same-origin", "none"]  # values of Sec-Fetch-Site: of the page itself, and of an address that was typed
OWN_HEADER = "X-Jacokin"  # of what the viewer's pages tell: browsers leave out Sec-Fetch-Site without encryption
HEADERS = {  # of every answer: no other page may hold this one in a frame, or learn the token from Referer
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
}

logger = logging.getLogger(__name__)
unheard = logging.getLogger(f"{__name__}.websockets")  # it logs each connection that a browser opens and does not use
unheard.setLevel(logging.CRITICAL + 1)
_starting = threading.Lock()

Answer = Response | None
Check = Callable[[ServerConnection, Request], Answer | Awaitable[Answer]]


class _Serve(Protocol):
    def __call__(self, handler: Callable[..., object], *args: object, **options: object) -> object: ...


class Server(viser.ViserServer):
    """Viser's server, which gives no public address and does not wait for pages when it ends."""

    guard: _Guard

    def listen(self, path: str, heard: Callable[[str], None]) -> None:
        """Call a function with the query of each request of the viewer's own pages for a path.

        A JacokinError of the function is the answer to its request.
        """
        self.guard.listeners[path] = heard

    def add_script(self, path: str, text: str) -> None:
        """Have every page that is opened from now on load a script of the viewer's own."""
        self.guard.scripts[path] = text.encode()

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse: a client may ask for this, and the viewer is for this machine."""
        logger.warning("a page asked for a public address, which the viewer does not give")
        return None

    def stop(self) -> None:
        """Stop serving and disconnect every page, without a message."""
        with quiet():
            self.guard.abandon()
            super().stop()


def start(host: str, port: int, label: str) -> tuple[Server, str]:
    """Start serving.

    Args:
        host: address or name of the interface.
        port: 0 for any free one.
        label: of the panel.

    Returns:
        The server, and the address of its page, with the token that lets it in.

    Raises:
        InvalidInputError: the host does not exist here, or the port is in use or not one.
        JacokinError: the installed viser does not start in the way that the checks rely on.
    """
    listening = bind(host, port)
    address, bound = listening.getsockname()[:2]
    guard = _Guard(listening, OwnPages(host), Token(bound))
    try:
        with _starting, quiet():
            genuine = websockets.asyncio.server.serve
            websockets.asyncio.server.serve = guard.over(genuine)  # type: ignore[assignment,misc]  # viser has no hook for it
            try:
                server = Server(host=LOOPBACK, port=bound, label=label, verbose=False)
                server.guard = guard
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
        logger.warning(
            "every computer that reaches %s:%d and knows the token can use the viewer, and nothing is encrypted",
            address,
            bound,
        )
    name = LOOPBACK if ipaddress.ip_address(address).is_unspecified else address
    place = f"[{name}]:{bound}" if ":" in name else f"{name}:{bound}"
    return server, f"http://{place}/?token={guard.token.text}"


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
    Requests that a page makes for pictures and the like have no Origin, and cookies are shared by all ports of a
    machine: from where they come is in Sec-Fetch-Site. A program that is not a browser sends neither.
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
        others = set(headers.get_all("Sec-Fetch-Site")) - set(OWN_SITES)
        if others and headers.get_all("Sec-Fetch-Dest") != ["document"]:  # of a page that is opened by a link
            return f"pages of others ({', '.join(others)}) may not use the viewer"
        return None

    def changes(self, headers: Headers) -> bool:
        """Whether a request of a page that may change something is of the viewer's own: nothing else says so.

        Other pages can send no header of their own choice here: a browser asks before, and is refused.
        """
        sites = headers.get_all("Sec-Fetch-Site")
        return sites == OWN_SITES[:1] or (not sites and ("Origin" in headers or OWN_HEADER in headers))

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


class Token:
    """What the address of the page has and no other user of the machine knows.

    A page brings it in its address and gets it back as a cookie, which its websocket then brings.
    """

    def __init__(self, port: int) -> None:
        """Make one up; cookies are shared by all ports of a host, so the port is in its name."""
        self.text = secrets.token_urlsafe(16)  # [byte]
        self._name = f"jacokin_viewer_{port}"

    @property
    def cookie(self) -> str:
        """For a page that brought the token: pages of other sites cannot use it, and no script can read it."""
        return f"{self._name}={self.text}; Path=/; HttpOnly; SameSite=Strict"

    def in_address(self, request: Request) -> bool:
        """Whether a request has the token in its address: pages of others do not know it."""
        return self._is_among(parse_qs(urlsplit(request.path).query).get("token", []))

    def brought_by(self, request: Request) -> bool:
        """Whether a request has the token, in its address or in its cookie."""
        pairs = (each.partition("=") for each in "; ".join(request.headers.get_all("Cookie")).split("; "))
        return self.in_address(request) or self._is_among([value for name, _, value in pairs if name == self._name])

    def _is_among(self, given: list[str]) -> bool:
        return any(secrets.compare_digest(each.encode("utf-8", "replace"), self.text.encode()) for each in given)


class _AnyMessage(msgspec.Struct):
    """Any message."""

    type: str


class _GizmoMoved(msgspec.Struct):
    position: tuple[float, float, float]
    wxyz: tuple[float, float, float, float]


class _ControlMoved(msgspec.Struct):
    uuid: str
    updates: dict[Literal["value"], Any]  # Any: what the control holds


FORMS: dict[str, type[msgspec.Struct]] = {
    "TransformControlsUpdateMessage": _GizmoMoved,
    "GuiUpdateMessage": _ControlMoved,
}


class _Connection(ServerConnection):
    """A connection that passes on nothing but messages of the right form: viser keeps what it gets."""

    async def recv(self, decode: bool | None = None) -> Any:  # Any: bytes or str, as the overloads of the original say
        while True:
            data = await super().recv(decode)
            packed = data.encode() if isinstance(data, str) else data
            try:
                kind = msgspec.msgpack.decode(packed, type=_AnyMessage).type
                msgspec.msgpack.decode(packed, type=FORMS.get(kind, _AnyMessage))
            except (msgspec.MsgspecError, UnicodeError) as error:
                logger.warning("ignored a message of a page: %s", error)
            else:
                return data


class _Guard:
    """Makes the server that viser starts use our socket and our checks."""

    def __init__(self, listening: socket.socket, pages: OwnPages, token: Token) -> None:
        self._listening = listening
        self._pages = pages
        self.listeners: dict[str, Callable[[str], None]] = {}
        self.scripts: dict[str, bytes] = {}
        self.token = token
        self.used = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._connections: weakref.WeakSet[_Connection] = weakref.WeakSet()

    def abandon(self) -> None:
        """Drop, after a while, the connections that are still open: a page that does not read never closes its own."""
        with contextlib.suppress(RuntimeError):  # the server has ended
            if self._loop is not None:
                self._loop.call_soon_threadsafe(self._loop.call_later, PATIENCE, self._drop)

    def _drop(self) -> None:
        for connection in list(self._connections):
            connection.transport.abort()

    def over(self, genuine: type[websockets.asyncio.server.serve]) -> _Serve:
        """What stands in for `websockets.asyncio.server.serve` while viser starts."""

        def serve(handler: Callable[..., object], *args: object, **options: object) -> object:
            if not (getattr(handler, "__module__", None) or "").startswith("viser."):
                return genuine(handler, *args, **options)  # type: ignore[arg-type]  # of another server: passed on
            self.used = True
            self._loop = asyncio.get_running_loop()
            self._loop.set_exception_handler(_report)
            options["create_connection"] = self._connect
            options["process_request"] = self._checked(options.get("process_request"))  # type: ignore[arg-type]  # viser's
            options["logger"] = unheard
            return genuine(handler, sock=self._listening, **options)  # type: ignore[arg-type]  # viser's options

        return serve

    def _connect(self, *args: Any, **options: Any) -> _Connection:  # Any: as websockets makes its own
        connection = _Connection(*args, **options)
        self._connections.add(connection)
        return connection

    def _checked(self, inner: Check | None) -> Check:
        async def check(connection: ServerConnection, request: Request) -> Answer:
            try:
                answer = self._refused(connection, request) or self._script(request) or self._told(connection, request)
                if answer is None and inner is not None:
                    is_page = urlsplit(request.path).path in ("/", "/index.html")  # which loads all else
                    if is_page:
                        request.headers.pop("Accept-Encoding", None)  # to add to the page as it is
                    found = inner(connection, request)
                    answer = await found if inspect.isawaitable(found) else found
                    if answer is not None:
                        answer.headers["Set-Cookie"] = self.token.cookie
                        if is_page:
                            self._add_scripts(answer)
            except (ValueError, LookupError, OSError) as error:  # an address or a header that no browser sends
                answer = connection.respond(http.HTTPStatus.BAD_REQUEST, f"not a request of a page: {error}\n")
            if answer is not None:
                answer.headers.update(HEADERS)
            return answer

        return check

    def _script(self, request: Request) -> Answer:
        """A script of the viewer's own."""
        text = self.scripts.get(urlsplit(request.path).path)
        if text is None or request.headers.get("Upgrade") == "websocket":
            return None
        headers = Headers({"Content-Type": "text/javascript; charset=utf-8", "Content-Length": str(len(text))})
        return Response(http.HTTPStatus.OK, "OK", headers, text)

    def _add_scripts(self, page: Response) -> None:
        """Have a page load the scripts."""
        tags = "".join(f'<script src="{path}"></script>' for path in self.scripts).encode()
        before, end, after = page.body.rpartition(b"</body>")
        page.body = before + tags + end + after
        del page.headers["Content-Length"]
        page.headers["Content-Length"] = str(len(page.body))

    def _told(self, connection: ServerConnection, request: Request) -> Answer:
        """Hand what a page says to who listens at that path."""
        asked = urlsplit(request.path)
        listen = self.listeners.get(asked.path)
        if listen is None:
            return None
        if not self.token.in_address(request) and not self._pages.changes(request.headers):
            return connection.respond(http.HTTPStatus.FORBIDDEN, "only a page of the viewer may tell this\n")
        try:
            listen(asked.query)
        except JacokinError as error:
            return connection.respond(http.HTTPStatus.BAD_REQUEST, f"{error}\n")
        return connection.respond(http.HTTPStatus.OK, "")

    def _refused(self, connection: ServerConnection, request: Request) -> Answer:
        refusal = self._pages.refusal(request.headers)
        if refusal is None and not self.token.brought_by(request):
            refusal = "open the address that the viewer printed, which ends with a token"
        return None if refusal is None else connection.respond(http.HTTPStatus.FORBIDDEN, f"{refusal}\n")


def _report(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:  # Any: as asyncio has it
    """Log in one line what viser could not do with a message."""
    error = context.get("exception")
    logger.warning("ignored a message of a page: %s", context["message"] if error is None else repr(error))
    logger.debug("%s", context["message"], exc_info=error)


@contextmanager
def quiet() -> Iterator[None]:
    """Without viser's messages on stdout."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
