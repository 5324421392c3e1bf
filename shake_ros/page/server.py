"""The page's server: files, recordings, results, and one socket for each page. Starlette and uvicorn, no ROS."""

from __future__ import annotations

import asyncio
import functools
import json
import socket
import ssl
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from shake_ros.core.quantities import ShakeError
from shake_ros.page.desk import Desk
from shake_ros.page.door import OPERATOR, Door, Keys, Seat
from shake_ros.page.jobs import Jobs
from shake_ros.page.library import Library, checked_name
from shake_ros.page.samples import SampleStore
from shake_ros.page.uploads import LARGEST, make_reference
from shake_ros.settings import config_folder

WEB = Path(__file__).resolve().parent / "web"
CHARTS = Path(__file__).resolve().parents[1] / "report" / "web"  # uPlot, which the reports have too
CHOICES = ("reference", "controller", "observer", "table")
STATUS = 0.2  # between two states [s]
MOST_PAGES = 64
# a report runs its own scripts, but in an origin of its own: nothing of this page is in its reach
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; frame-ancestors 'self'"
)
# Space stops the table even while the report has the focus
SPACE = b"""<script>addEventListener('keydown', e => { if (e.code === 'Space' && !e.shiftKey) {
e.preventDefault(); parent.postMessage('stop', '*') } }, true)</script>"""


@dataclass(frozen=True)
class Site:
    """What the server shows and asks. host : address to listen on; port : 0 takes a free one."""

    desk: Desk
    store: SampleStore
    library: Library
    jobs: Jobs
    folder: Path
    host: str
    port: int
    certificate: str = ""
    key: str = ""
    name: str = ""


class Server:
    """Serves in a thread of its own until `close`.

    Attributes
    ----------
    seat : of the operator. pages : how many are open. url : for the operator, with the token.
    """

    def __init__(self, site: Site) -> None:
        from shake_ros.page.live import live

        self.site, self.seat, self.keys = site, Seat(), Keys()
        self.pages = 0
        self._told_at, self._told = 0.0, ""
        self._socket = _listen(site.host, site.port)
        port = self._socket.getsockname()[1]
        names = {"127.0.0.1", "localhost", site.host, *([site.name] if site.name else [])}
        self.scheme = "https" if site.certificate else "http"
        self.cookie = f"shake_{port}"
        shown = site.name or ("127.0.0.1" if site.host in ("0.0.0.0", "::") else site.host)
        self._address = f"{self.scheme}://{shown}:{port}/"
        routes = [
            Route("/", self._enter),
            Route("/api/choices", self._choices),
            Route("/api/parameters", self._parameters),
            Route("/api/recordings", self._recordings),
            Route("/api/spectators", self._spectators),
            Route("/api/upload", self._upload, methods=["POST"]),
            Route("/results/{out}/report.html", self._report),
            WebSocketRoute("/live", functools.partial(_with_server, live, self)),
            Mount("/web", StaticFiles(directory=WEB)),
            Mount("/charts", StaticFiles(directory=CHARTS)),
        ]
        app = Starlette(routes=routes, exception_handlers={ShakeError: _refused})
        hosts = {f"{name}:{port}" for name in names}
        door = Door(app, self.keys, hosts, self.scheme, self.cookie)
        settings = uvicorn.Config(
            door, log_level="warning", access_log=False, lifespan="off", ws_max_size=1 << 16, ws_max_queue=8,
            ws_per_message_deflate=False, timeout_graceful_shutdown=1, server_header=False, date_header=False,
            ssl_certfile=site.certificate or None, ssl_keyfile=site.key or None, limit_concurrency=4 * MOST_PAGES,
        )  # fmt: skip
        try:
            settings.load()
        except (OSError, ssl.SSLError) as error:
            raise ShakeError(f"certificate {site.certificate}, key {site.key}: {error}") from None
        self._server = uvicorn.Server(settings)
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)

    @property
    def url(self) -> str:
        """The operator's address."""
        return f"{self._address}?token={self.keys.tokens[OPERATOR]}"

    def status(self) -> str:
        """The desk's status as JSON, made once for all pages."""
        now = time.monotonic()
        if now - self._told_at >= STATUS:
            self._told_at, self._told = now, json.dumps(self.site.desk.status())
        return self._told

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def _serve(self) -> None:
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """Hang up on all pages."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join(3.0)
        self._socket.close()

    async def _enter(self, request: Request) -> Response:
        """The token of the address becomes a cookie; then the page itself."""
        token = request.query_params.get("token", "")
        if self.keys.role(token):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(
                self.cookie, token, httponly=True, samesite="strict", secure=self.scheme == "https", path="/"
            )
            return answer
        if token or not request.scope["state"]["role"]:
            return PlainTextResponse("open the address that the lab printed: it carries this start's token\n", 403)
        return FileResponse(WEB / "index.html")

    async def _choices(self, _request: Request) -> Response:
        found = {kind: sorted(path.stem for path in (config_folder() / kind).glob("*.yaml")) for kind in CHOICES}
        uploads = sorted(str(path) for path in (self.site.folder / "uploads").glob("*.yaml"))
        tables = sorted(str(path) for path in (self.site.folder / "results").glob("*/table.yaml"))
        found["reference"] += uploads
        found["table"] += tables
        return JSONResponse(found)

    async def _parameters(self, _request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(self.site.desk.parameters))

    async def _recordings(self, _request: Request) -> Response:
        running = Path(self.site.desk.status().get("recording", "")).name
        return JSONResponse(await run_in_threadpool(self.site.library.entries, running))

    async def _spectators(self, request: Request) -> Response:
        _operators_only(request)
        return JSONResponse({"url": f"{self._address}?token={self.keys.tokens['spectator']}"})

    async def _upload(self, request: Request) -> Response:
        _operators_only(request)
        parts = bytearray()
        async for chunk in request.stream():
            parts += chunk
            if len(parts) > LARGEST:
                raise ShakeError(f"larger than {LARGEST // 1024 // 1024} MiB")
        name, unit = request.query_params.get("name", ""), request.query_params.get("unit", "")
        channel = request.query_params.get("channel") or "0"
        if not channel.isdecimal() or len(channel) > 3:
            raise ShakeError(f"component '{channel}': a number from 1 is needed")
        folder, step = self.site.folder / "uploads", self.site.store.sample_time
        made = await run_in_threadpool(make_reference, folder, name, bytes(parts), unit, step, int(channel))
        return JSONResponse({"reference": str(made)} if isinstance(made, Path) else {"columns": str(made)})

    async def _report(self, request: Request) -> Response:
        path = self.site.jobs.folder / checked_name(request.path_params["out"]) / "report.html"
        if not path.is_file():
            raise ShakeError("no report yet")
        content = await run_in_threadpool(path.read_bytes)
        headers = {"content-security-policy": REPORT_POLICY, "x-frame-options": "SAMEORIGIN"}
        return Response(content + SPACE, media_type="text/html; charset=utf-8", headers=headers)


async def _with_server(act: Callable[[Server, WebSocket], Any], server: Server, page: WebSocket) -> None:
    await act(server, page)


def _operators_only(request: Request) -> None:
    if request.scope["state"]["role"] != OPERATOR:
        raise ShakeError("spectators see all and change nothing")


async def _refused(_request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, 400)


def _listen(host: str, port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((host, port))
        made.listen(128)
    except (OSError, OverflowError) as error:
        made.close()
        raise ShakeError(f"page on {host}:{port}: {error}; take another port, or 0 for any") from None
    return made
