"""Who may talk to the dashboard: its own page, in a browser that came by an address of this machine.

A page from elsewhere may make a browser beside the robot send a request; but a browser says where the page came from
(Origin) and whom it asked (Host). Commands and the WebSocket want an Origin that is the Host; and the Host must be an
address, or a name of this machine: a stranger's name that was made to point here is neither.
"""

import ipaddress
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

#: Only what is shipped with the page, nothing inline, nobody else's frame.
_HEADERS = [
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        b"base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
]
_POLICY_VIOLATION = 1008


def is_own(host: str) -> bool:
    """Is this Host header an address, or a name of this machine?

    >>> is_own("127.0.0.1:8080"), is_own("localhost"), is_own("[::1]:8080"), is_own("evil.example:8080")
    (True, True, True, False)
    """
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    mine = socket.gethostname().lower()
    if name in ("localhost", mine, f"{mine}.local"):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_allowed(host: str, origin: str | None, *, wants_origin: bool) -> bool:
    """May a request with this Host and Origin pass?

    >>> is_allowed("127.0.0.1:8080", "http://127.0.0.1:8080", wants_origin=True)
    True
    >>> is_allowed("127.0.0.1:8080", "http://elsewhere.example", wants_origin=True)
    False
    """
    if not is_own(host):
        return False
    if origin is None:
        return not wants_origin
    try:
        return urlsplit(origin).netloc == host
    except ValueError:
        return False


class Guard:
    """Lets through what may pass, and puts the headers on what goes out.

    Args:
        app: what it stands before.
    """

    def __init__(self, app: App) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request, or one WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        wants_origin = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if not is_allowed(headers.get("host", ""), headers.get("origin"), wants_origin=wants_origin):
            await _refuse(scope, receive, send)
            return

        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *_HEADERS]
            await send(message)

        await self._app(scope, receive, dressed)


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        return
    text = b"refused: only the dashboard's own page may ask, by an address or a name of the machine it runs on\n"
    await send({"type": "http.response.start", "status": 403, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": text})
