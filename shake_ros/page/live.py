"""One open page: what it is sent, and what it asks for.

Each page has its own pace: it gets the next frame when it has taken the last one. A page that stops reading holds
nothing and nobody up; when it reads again it goes on with the newest samples.
"""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from shake_ros.core.quantities import ShakeError
from shake_ros.page.desk import Answer
from shake_ros.page.door import OPERATOR, Allowance
from shake_ros.page.library import checked_name
from shake_ros.page.samples import LEVELS

if TYPE_CHECKING:
    from shake_ros.page.server import Server

FRAME = 1.0 / 30.0  # [s]
STATUS = 0.2  # [s]
PATIENCE = 20.0  # for an answer of the graph [s]
COMPILING = 120.0  # for one that another table is built for: it may have to be compiled [s]
RATE, BURST = 60.0, 200  # messages of one page
FREE = ("stop", "here", "view", "between")  # need no seat; `stop` needs an operator's token all the same
LONGEST_NOTE = 2000
GRAPH = ("enable", "reset", "set", "restart", "table", "model")
KINDS = ("identify", "close_loop")


class LivePage:
    """A page and its view."""

    def __init__(self, server: Server, socket: WebSocket) -> None:
        self.server, self.socket = server, socket
        self.operator = socket.scope["state"]["role"] == OPERATOR
        self.level, self.window, self.first, self.paused = 3, 10.0, 0, False
        self._epoch = -1
        self._sending = asyncio.Lock()

    async def send(self, message: dict[str, Any]) -> None:
        """A text message."""
        async with self._sending:
            await self.socket.send_text(json.dumps(message))

    async def send_bytes(self, data: bytes) -> None:
        """A frame."""
        async with self._sending:
            await self.socket.send_bytes(data)

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
                await self.send_bytes(data)

    async def states(self) -> None:
        """What else changes."""
        server = self.server
        while True:
            seat = server.seat
            mine = seat.holder is self
            if self.operator and seat.holder is None:
                seat.take(self)
                mine = True
            jobs = [job.told() for job in server.site.jobs.all[-5:]]
            role = "operator" if mine else "waiting" if self.operator else "spectator"
            now = {
                "type": "status",
                "role": role,
                "taken": seat.holder is not None,
                "pages": server.pages,
                "jobs": jobs,
            }
            text = f"{json.dumps(now)[:-1]}, {server.status()[1:]}"
            async with self._sending:
                await self.socket.send_text(text)
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
            done, text = False, f"{what}: something is missing or wrong in the request"
        except asyncio.TimeoutError:
            done, text = False, f"{what}: no answer from the graph in time"
        if self.socket.application_state is WebSocketState.CONNECTED:
            await self.send({"type": "answer", "id": message.get("id"), "ok": done, "text": text, "do": what})

    async def do(self, what: str, message: dict[str, Any]) -> Answer:
        """One request; ShakeError with the reason where it is refused."""
        server = self.server
        if what == "between":
            level = min(max(int(message["level"]), 0), LEVELS - 1)
            data = server.site.store.between(level, float(message["start"]), float(message["stop"]))
            await self.send_bytes(b"zoom" + data)
            return Answer(True, "")
        if not self.operator:
            raise ShakeError("spectators see all and change nothing")
        if what == "take":
            server.seat.take(self)
            return Answer(True, "you have the controls")
        if what not in FREE and server.seat.holder is not self:
            raise ShakeError("another page has the controls: take them first")
        if what == "stop" or what in GRAPH:
            how = {name: value for name, value in message.items() if name not in ("do", "id")}
            patience = COMPILING if what in ("table", "model") else PATIENCE
            return await asyncio.wait_for(asyncio.wrap_future(server.site.desk.ask(what, **how)), patience)
        if what == "record":
            name = checked_name(str(message["name"]))
            note = str(message.get("note", ""))[:LONGEST_NOTE]
            return await asyncio.wait_for(asyncio.wrap_future(server.site.desk.ask("record", name=name, note=note)), 30)
        if what == "stop_recording":
            return await asyncio.wait_for(asyncio.wrap_future(server.site.desk.ask("stop_recording")), 30)
        if what == "job":
            return await run_in_threadpool(self._start, message)
        if what == "cancel":
            return Answer(True, server.site.jobs.cancel())
        raise ShakeError(f"{what[:40]!r} is nothing that can be asked for")

    def _start(self, message: dict[str, Any]) -> Answer:
        """A job on recordings of the library."""
        site = self.server.site
        kind = message["kind"]
        if kind not in KINDS:
            raise ShakeError(f"no job {kind!r}; there are {', '.join(KINDS)}")
        learn, hold = (list(message.get(key) or []) for key in ("learn", "hold"))
        if not learn or (kind == "close_loop" and not hold):
            raise ShakeError(
                "mark at least one recording for estimation" + (" and one for validation" * (kind != "identify"))
            )
        arguments = ["--learn", *(_shown(site.library.path(name)) for name in learn)]
        if hold:
            arguments += ["--hold", *(_shown(site.library.path(name)) for name in hold)]
        if message.get("table"):
            arguments += ["--config", str(message["table"])]
        if kind == "close_loop":
            arguments.append("--tune")  # "use this table" gives the loop its gains too
        job = site.jobs.start(kind, arguments, f"{kind}_{'_'.join(learn)}"[:60])
        return Answer(True, f"started: {job.command}")


def _shown(path: Path) -> str:
    """A path as one would type it from here."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)


async def live(server: Server, socket: WebSocket) -> None:
    """Serve one page until it goes."""
    from shake_ros.page.server import MOST_PAGES

    if server.pages >= MOST_PAGES:
        await socket.close(1013, "too many pages")
        return
    await socket.accept()
    server.pages += 1
    page = LivePage(server, socket)
    tasks = [asyncio.create_task(act()) for act in (page.frames, page.states, page.listen)]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            if (
                task.done()
                and (error := task.exception())
                and not isinstance(error, WebSocketDisconnect | RuntimeError)
            ):
                raise error
    finally:
        server.pages -= 1
        server.seat.leave(page)
        for task in tasks:
            task.cancel()
