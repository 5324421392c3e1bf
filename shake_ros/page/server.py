"""The page's server: files, recordings, results, and one socket for each page. Starlette and uvicorn, no ROS.

Each page has its own pace: it gets the next frame when it has taken the last one. A page that stops reading holds
nothing and nobody up; when it reads again it goes on with the newest samples.
"""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import threading
import time
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
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from shake_ros.page.authentication import OPERATOR, Allowance, Authentication, Keys, Seat
from shake_ros.page.desk import Answer, Desk
from shake_ros.page.jobs import Jobs
from shake_ros.page.library import LARGEST, Library, checked_name, make_reference
from shake_ros.page.samples import LEVELS, SampleStore
from shake_ros.quantities import ShakeError
from shake_ros.settings import config_folder

FRAME = 1.0 / 30.0  # [s]
STATUS = 0.2  # [s]
TIMEOUT = 20.0  # for an answer of the graph [s]
COMPILING = 120.0  # for one that another table is built for: it may have to be compiled [s]
RECORDING = 30.0  # for a recording that begins or ends [s]
RATE, BURST = 60.0, 200  # messages of one page
FREE = ("stop", "here", "view", "between")  # need no seat; `stop` needs an operator's token all the same
LONGEST_NOTE = 2000
GRAPH = ("enable", "reset", "set", "restart", "table", "model")
KINDS = {"identify": (), "close_loop": ("--tune",), "decide": ("--next", "--live")}  # job → its options
RELEASED_BY = "the operator at the page"


class LivePage:
    """A page and its view."""

    def __init__(self, server: Server, socket: WebSocket) -> None:
        self.server, self.socket = server, socket
        self.operator = socket.scope["state"]["role"] == OPERATOR
        self.level, self.window, self.first, self.paused = 3, 10.0, 0, False
        self._epoch, self._later = -1, 0
        self._sending = asyncio.Lock()

    async def send(self, data: str | bytes) -> None:
        """A message, or a frame."""
        async with self._sending:
            await (self.socket.send_text(data) if isinstance(data, str) else self.socket.send_bytes(data))

    async def frames(self) -> None:
        """The newest buckets, again and again; the pace is kept, however long a frame takes."""
        store = self.server.site.store
        clock = asyncio.get_running_loop().time
        due = clock()
        while True:
            due = max(due + FRAME, clock())
            await asyncio.sleep(due - clock())
            if self.paused:
                continue
            if store.epoch != self._epoch:
                self._epoch, self.first = store.epoch, 0
            data, self.first = store.frame(self.level, self.first, self.window)
            if data:
                await self.send(data)

    async def states(self) -> None:
        """What else changes."""
        server = self.server
        while True:
            if (later := server.site.store.later) != self._later:
                self.first, self._later = min(self.first, self._later >> self.level), later
            seat = server.seat
            mine = seat.holder is self
            if self.operator and seat.holder is None:
                seat.take(self)
                mine = True
            jobs = [job.status() for job in server.site.jobs.all[-5:]]
            role = "operator" if mine else "waiting" if self.operator else "spectator"
            taken = seat.holder is not None
            now = {"type": "status", "role": role, "taken": taken, "pages": server.pages, "jobs": jobs}
            await self.send(f"{json.dumps(now)[:-1]}, {server.status()[1:]}")
            await asyncio.sleep(STATUS)

    async def listen(self) -> None:
        """What the page asks for, one after the other but for `stop`, which waits for nothing."""
        allowance, waiting = Allowance(RATE, BURST), asyncio.Semaphore(1)
        tasks: set[asyncio.Task[None]] = set()
        while True:
            text = await self.socket.receive_text()
            if not allowance.spend():
                await self.socket.close(1008, "too many messages")
                return
            try:
                message = json.loads(text)
                what = str(message["do"])
            except (ValueError, KeyError, TypeError):
                await self.socket.close(1003, "not a message of this page")
                return
            if what in ("here", "view"):
                self.look(what, message)
                continue
            task = asyncio.create_task(self.answer(what, message, waiting))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

    def look(self, what: str, message: dict[str, Any]) -> None:
        """`here`: the operator is at the page. `view`: another window, level or pause."""
        self.server.seat.here(self)
        if what == "view":
            try:
                self.level = min(max(int(message["level"]), 0), LEVELS - 1)
                self.window = min(max(float(message["window"]), 1.0), 120.0)
            except (KeyError, TypeError, ValueError, OverflowError):
                return
            self.paused = bool(message.get("paused"))
            self.first = 0

    async def answer(self, what: str, message: dict[str, Any], waiting: asyncio.Semaphore) -> None:
        """Do what is asked and say how it ended."""
        try:
            if what == "stop":
                done, text = await self.do(what, message)
            else:
                async with waiting:
                    done, text = await self.do(what, message)
        except ShakeError as error:
            done, text = False, str(error)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
            done, text = False, f"{what}: the request is incomplete or wrong"
        except asyncio.TimeoutError:
            done, text = False, f"{what}: no answer from the graph in time"
        if self.socket.application_state is WebSocketState.CONNECTED:
            answer = {"type": "answer", "id": message.get("id"), "ok": done, "text": text, "do": what}
            await self.send(json.dumps(answer))

    async def do(self, what: str, message: dict[str, Any]) -> Answer:
        """One request; ShakeError with the reason where it is refused."""
        server = self.server
        if what == "between":
            level = min(max(int(message["level"]), 0), LEVELS - 1)
            data = server.site.store.between(level, float(message["start"]), float(message["stop"]))
            await self.send(b"zoom" + data)
            return Answer(True, "")
        if not self.operator:
            raise ShakeError("spectators can watch, not change anything")
        if what == "take":
            server.seat.take(self)
            return Answer(True, "you have the controls")
        if what not in FREE and server.seat.holder is not self:
            raise ShakeError("another page has the controls: take them first")
        if what == "stop" or what in GRAPH:
            how = {name: value for name, value in message.items() if name not in ("do", "id")}
            return await self.ask(COMPILING if what in ("table", "model") else TIMEOUT, what, **how)
        if what == "record":
            name = checked_name(str(message["name"]))
            return await self.ask(RECORDING, what, name=name, note=str(message.get("note", ""))[:LONGEST_NOTE])
        if what == "stop_recording":
            return await self.ask(RECORDING, what)
        if what == "job":
            return await run_in_threadpool(self._start, message)
        if what == "cancel":
            return Answer(True, server.site.jobs.cancel())
        if what == "release":
            return Answer(True, server.site.jobs.release(RELEASED_BY if message["released"] is True else ""))
        raise ShakeError(f"{what[:40]!r} is not a known request")

    async def ask(self, timeout: float, what: str, **how: Any) -> Answer:
        """The graph's answer; TimeoutError after `timeout` [s] without one."""
        return await asyncio.wait_for(asyncio.wrap_future(self.server.site.desk.ask(what, **how)), timeout)

    def _start(self, message: dict[str, Any]) -> Answer:
        """A job on recordings of the library."""
        site = self.server.site
        kind = message["kind"]
        if kind not in KINDS:
            raise ShakeError(f"no job {kind!r}; there are {', '.join(KINDS)}")
        learn, hold = (list(message.get(key) or []) for key in ("learn", "hold"))
        if not learn or (kind != "identify" and not hold):
            raise ShakeError(
                "mark at least one recording for estimation" + (" and one for validation" * (kind != "identify"))
            )
        arguments = ["--learn", *(_shown(site.library.path(name)) for name in learn)]
        if hold:
            arguments += ["--hold", *(_shown(site.library.path(name)) for name in hold)]
        if message.get("table"):
            arguments += ["--config", str(message["table"])]
        arguments += KINDS[kind]  # --tune: "use this table" gives the loop its gains too
        if kind == "decide":
            arguments += ["--namespace", site.desk.namespace]
        command = "identify" if kind == "identify" else "close_loop"
        of = {"kind": kind, "learn": learn, "hold": hold, "table": message.get("table")}
        job = site.jobs.start(command, arguments, f"{kind}_{'_'.join(learn)}"[:60], of)
        return Answer(True, f"started: {job.command}")


def _shown(path: Path) -> str:
    """A path as one would type it from here."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)


WEB = Path(__file__).resolve().parent / "web"
CHARTS = Path(__file__).resolve().parents[1] / "report" / "web"  # uPlot, which the reports have too
CHOICES = ("reference", "controller", "observer", "table")
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
    seat : of the operator.
    pages : how many are open.
    url : for the operator, with the token.
    """

    def __init__(self, site: Site) -> None:
        self.site, self.seat, self.keys = site, Seat(), Keys()
        self.pages = 0
        self._status_at, self._status = 0.0, ""
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
            Route("/api/twin", self._twin),
            Route("/api/recordings", self._recordings),
            Route("/api/spectators", self._spectators),
            Route("/api/upload", self._upload, methods=["POST"]),
            Route("/results/{page:path}/report.html", self._report),
            WebSocketRoute("/live", self._live),
            Mount("/web", StaticFiles(directory=WEB)),
            Mount("/charts", StaticFiles(directory=CHARTS)),
        ]
        app = Starlette(routes=routes, exception_handlers={ShakeError: _refused})
        hosts = {f"{name}:{port}" for name in names}
        authenticated = Authentication(app, self.keys, hosts, self.scheme, self.cookie)
        settings = uvicorn.Config(
            authenticated, log_level="warning", access_log=False, lifespan="off", ws_max_size=1 << 16, ws_max_queue=8,
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
        if now - self._status_at >= STATUS:
            self._status_at, self._status = now, json.dumps(self.site.desk.status())
        return self._status

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

    async def _live(self, socket: WebSocket) -> None:
        """Serve one page until it goes."""
        if self.pages >= MOST_PAGES:
            await socket.close(1013, "too many pages")
            return
        await socket.accept()
        self.pages += 1
        page = LivePage(self, socket)
        tasks = [asyncio.create_task(act()) for act in (page.frames, page.states, page.listen)]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for error in (task.exception() for task in done):
                if error and not isinstance(error, WebSocketDisconnect | RuntimeError):
                    raise error
        finally:
            self.pages -= 1
            self.seat.leave(page)
            for task in tasks:
                task.cancel()

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
            return PlainTextResponse(
                "open the address that the lab printed: it contains the token of this start\n", 403
            )
        return FileResponse(WEB / "index.html")

    async def _choices(self, _request: Request) -> Response:
        found = {kind: sorted(path.stem for path in (config_folder() / kind).glob("*.yaml")) for kind in CHOICES}
        found["reference"] += sorted(map(str, (self.site.folder / "uploads").glob("*.yaml")))
        found["table"] += sorted(map(str, (self.site.folder / "results").glob("*/table.yaml")))
        return JSONResponse(found)

    async def _parameters(self, _request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(self.site.desk.parameters))

    async def _twin(self, _request: Request) -> Response:
        return JSONResponse(self.site.desk.twin())

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
        folders = map(checked_name, request.path_params["page"].split("/"))
        path = self.site.jobs.folder.joinpath(*folders, "report.html")
        if not path.is_file():
            raise ShakeError("no report yet")
        content = await run_in_threadpool(path.read_bytes)
        headers = {"content-security-policy": REPORT_POLICY, "x-frame-options": "SAMEORIGIN"}
        return Response(content + SPACE, media_type="text/html; charset=utf-8", headers=headers)


def _operators_only(request: Request) -> None:
    if request.scope["state"]["role"] != OPERATOR:
        raise ShakeError("spectators can watch, not change anything")


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
