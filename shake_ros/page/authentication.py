"""Authentication of the page: tokens, Host and Origin, one operator at a time.

The address that `lab` prints carries the operator's token; the page offers another one for spectators, who see all and
change nothing. A token becomes a cookie that scripts cannot read and other sites do not send.
"""

from __future__ import annotations

import hmac
import secrets
import time
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

OPERATOR, SPECTATOR = "operator", "spectator"
PRESENT = 0.7  # the operator's page says so often that it is there [s]
SAFE_METHODS = ("GET", "HEAD")
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


@dataclass
class Keys:
    """The tokens of this start, by role."""

    tokens: dict[str, str] = field(
        default_factory=lambda: {role: secrets.token_urlsafe(24) for role in (OPERATOR, SPECTATOR)}
    )

    def role(self, token: str) -> str:
        """Who holds a token; empty for nobody."""
        found = ""
        for role, known in self.tokens.items():
            if hmac.compare_digest(token.encode(), known.encode()):
                found = role
        return found


class Seat:
    """The operator's seat: one page has it, the first that came; another takes it only by asking for it."""

    def __init__(self) -> None:
        self.holder: object = None
        self._present_at = 0.0

    def take(self, page: object) -> None:
        """Sit down."""
        self.holder = page
        self.here(page)

    def here(self, page: object) -> None:
        """The holder is at the page."""
        if page is self.holder:
            self._present_at = time.monotonic()

    def leave(self, page: object) -> None:
        """Stand up."""
        if page is self.holder:
            self.holder = None

    @property
    def occupied(self) -> bool:
        """Whether an operator's page is there and answers."""
        return self.holder is not None and time.monotonic() - self._present_at < PRESENT


class Authentication:
    """ASGI middleware: it refuses a foreign Host or Origin, or no token, and adds the headers to every answer.

    Parameters
    ----------
    inside : the application.
    keys : of this start.
    hosts : names with port under which the page may be called.
    scheme : http or https.
    cookie : its name.
    """

    def __init__(self, inside: ASGIApp, keys: Keys, hosts: set[str], scheme: str, cookie: str) -> None:
        self._inside, self._keys, self._hosts, self._cookie = inside, keys, hosts, cookie
        self._origins = {f"{scheme}://{host}" for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._inside(scope, receive, send)
            return
        headers = Headers(scope=scope)
        role = self._keys.role(self._token(headers))
        wrong = self._wrong(scope, headers, role)
        if wrong and scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": wrong})
        elif wrong:
            await PlainTextResponse(f"{wrong}\n", 403)(scope, receive, _with_headers(send))
        else:
            scope.setdefault("state", {})["role"] = role
            await self._inside(scope, receive, _with_headers(send) if scope["type"] == "http" else send)

    def _token(self, headers: Headers) -> str:
        cookies: SimpleCookie = SimpleCookie()
        try:
            cookies.load(headers.get("cookie", ""))
        except CookieError:
            return ""
        return cookies[self._cookie].value if self._cookie in cookies else ""

    def _wrong(self, scope: Scope, headers: Headers, role: str) -> str:
        """Why a request is refused; empty where it is not."""
        if headers.getlist("host") != [headers.get("host")] or headers["host"] not in self._hosts:
            return "the Host header does not name this page"
        origin = headers.get("origin")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        if (changes or origin is not None) and origin not in self._origins:
            return "the request comes from another site"
        entering = scope["type"] == "http" and scope["path"] == "/"
        return "" if role or entering else "open the address that the lab printed: it contains the token of this start"


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            present = {name.lower() for name, _ in message["headers"]}
            message["headers"] = [
                *message["headers"],
                *((k.encode(), v.encode()) for k, v in HEADERS.items() if k.encode() not in present),
            ]
        await send(message)

    return sending


class Allowance:
    """So many messages a second from one page, and a burst.

    >>> allowance = Allowance(1.0, 2)
    >>> [allowance.spend() for _ in range(3)]
    [True, True, False]
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._rate, self._burst, self._left, self._at = rate, float(burst), float(burst), time.monotonic()

    def spend(self) -> bool:
        """Whether one more is allowed now."""
        now = time.monotonic()
        self._left = min(self._burst, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
