"""The page's server without ROS: who may come in, what is refused, and that no page holds anybody up."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("websockets")
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from shake_ros.page.desk import Answer
from shake_ros.page.jobs import Job, Jobs
from shake_ros.page.library import Library
from shake_ros.page.samples import HEADER, ROW, Prediction, SampleStore
from shake_ros.page.server import Server, Site

MS = 1_000_000
START = 1_700_000_000_000 * MS


class QuietDesk:
    """A graph that does what it is asked, and remembers it."""

    namespace = "/shake"

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []

    def status(self) -> dict[str, Any]:
        return {"state": "off", "recording": ""}

    def parameters(self) -> dict[str, list[dict[str, Any]]]:
        return {"plant": []}

    def twin(self) -> dict[str, Any]:
        return {"time": [2.0], "parameters": [], "changes": []}

    def ask(self, what: str, **how: Any) -> Future[Answer]:
        self.asked.append((what, how))
        future: Future[Answer] = Future()
        future.set_result(Answer(True, f"{what} done"))
        return future


class Running:
    """A server with samples at 1 kHz, and ways to reach it."""

    def __init__(self, folder: Path) -> None:
        (folder / "recordings").mkdir()
        self.desk, self.store = QuietDesk(), SampleStore(MS, Prediction(0.001, None))
        library = Library(folder / "recordings")
        jobs = Jobs(folder / "results", library.take)
        self.server = Server(Site(self.desk, self.store, library, jobs, folder, "127.0.0.1", 0))
        self.host = self.server._address.removeprefix("http://").rstrip("/")
        self.server.start()
        self._going = True
        self._feeder = threading.Thread(target=self._feed, daemon=True)
        self._feeder.start()

    def _feed(self) -> None:
        k = 0
        while self._going:
            self.store.add("joint_states", START + (k + np.arange(33)) * MS, np.zeros((33, 1)))
            self.store.settle()
            k += 33
            time.sleep(0.033)

    def close(self) -> None:
        self._going = False
        self._feeder.join()
        self.server.close()

    def headers(self, role: str = "operator", **changed: str) -> dict[str, str]:
        token = self.server.keys.tokens[role] if role else "x" * 32
        usual = {"Host": self.host, "Cookie": f"{self.server.cookie}={token}", "Origin": f"http://{self.host}"}
        return {name: value for name, value in {**usual, **changed}.items() if value}

    def request(self, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, str]:
        connection = http.client.HTTPConnection(self.host, timeout=10)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in {**self.headers(), **headers}.items():
            if value:
                connection.putheader(name, value)
        connection.putheader("Content-Length", str(len(body)))
        connection.endheaders()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            connection.send(body)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()

    @contextlib.contextmanager
    def page(self, role: str = "operator", **changed: str) -> Iterator[Any]:
        headers = self.headers(role, **changed)
        origin, cookie = headers.get("Origin"), headers.get("Cookie", "")
        address = f"ws://{headers['Host'] if 'Host' in changed else self.host}/live"
        with connect(
            address, origin=origin, additional_headers={"Cookie": cookie}, max_size=None, open_timeout=10,
            sock=None if "Host" not in changed else _socket(self.host), proxy=None, close_timeout=1,
        ) as socket:  # fmt: skip
            yield socket


def _socket(host: str) -> Any:
    import socket

    return socket.create_connection((host.partition(":")[0], int(host.partition(":")[2])))


def ask(socket: Any, what: str, **how: Any) -> dict[str, Any]:
    socket.send(json.dumps({"do": what, "id": 7, **how}))
    return until(socket, lambda message: message.get("type") == "answer")


def until(socket: Any, wanted: Any) -> dict[str, Any]:
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        data = socket.recv(timeout=10)
        if isinstance(data, str) and wanted(message := json.loads(data)):
            return message
    raise AssertionError("no such message")


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    made = Running(tmp_path)
    try:
        yield made
    finally:
        made.close()


def test_token_becomes_a_cookie_that_scripts_and_other_sites_do_not_get(running) -> None:
    connection = http.client.HTTPConnection(running.host, timeout=10)
    connection.request("GET", running.server.url.removeprefix(f"http://{running.host}"))
    answer = connection.getresponse()
    assert (answer.status, answer.headers["location"]) == (303, "/")
    assert "HttpOnly" in answer.headers["set-cookie"]
    assert "SameSite=strict" in answer.headers["set-cookie"]
    assert running.request("GET", "/", Origin="")[0] == 200


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {"Cookie": ""}),
        ("/?token=forged", {"Cookie": ""}),
        ("/api/recordings", {"Cookie": ""}),
        ("/api/recordings", {"Cookie": "shake_1=x; =; \x7f"}),
        ("/web/main.js", {"Cookie": ""}),
        ("/api/recordings", {"Origin": "http://evil.example"}),
        ("/api/recordings", {"Host": "evil.example"}),
        ("/", {"Host": "127.0.0.1:1"}),
    ],
)
def test_forged_token_foreign_origin_and_foreign_host_stay_outside(running, path, headers) -> None:
    assert running.request("GET", path, **headers)[0] == 403


@pytest.mark.parametrize(
    ("role", "changed"),
    [
        ("", {}),
        ("operator", {"Origin": "http://evil.example"}),
        ("operator", {"Origin": "null"}),
        ("operator", {"Origin": ""}),
        ("operator", {"Host": "evil.example:80"}),
    ],
)
def test_socket_is_refused_without_a_token_or_from_elsewhere(running, role, changed) -> None:
    with pytest.raises(InvalidStatus, match="403"), running.page(role, **changed):
        pass


@pytest.mark.parametrize(
    "path",
    [
        "/results/..%2f..%2fsetup.cfg/report.html",
        "/results/%2e%2e/report.html",
        "/results/a/../../report.html",
        "/results//etc/report.html",
        "/web/../server.py",
        "/web/..%2fserver.py",
        "/charts/%2e%2e/page.py",
        "/api/upload?name=../../evil.at2",
        "/api/upload?name=/etc/passwd",
        "/api/upload?name=evil.sh",
        "/api/upload?name=%00.at2",
    ],
)
def test_path_in_a_name_leads_nowhere(running, path) -> None:
    method = "POST" if "upload" in path else "GET"
    status, text = running.request(method, path, b"1 2\n3 4\n" if method == "POST" else b"")
    assert status in (400, 404)
    assert "Traceback" not in text
    folder = running.server.site.folder
    assert sorted(p.name for p in folder.rglob("*") if p.is_file()) == []


def test_oversized_upload_is_refused_and_leaves_nothing(running) -> None:
    status, text = running.request("POST", "/api/upload?name=big.at2", b"9 " * (5 << 20))
    assert (status, "larger than 8 MiB" in text) == (400, True)
    assert not list(running.server.site.folder.rglob("big*"))


def test_accelerogram_becomes_a_reference_and_nonsense_is_refused_with_its_reason(running) -> None:
    time_ = np.arange(0.0, 6.0, 0.01)
    lines = "".join(f"{t:.3f} {2.0 * np.sin(9 * t) * np.sin(np.pi * t / 6) ** 2:.6f}\n" for t in time_)
    status, text = running.request("POST", "/api/upload?name=quake.txt&unit=m/s2", lines.encode())
    assert status == 200, text
    assert Path(json.loads(text)["reference"]).is_file()
    both = "t [s];N-S [g];E-W [g]\n" + "".join(
        line.replace(" ", ";").replace("\n", ";0.1\n") for line in lines.splitlines(True)
    )
    status, text = running.request("POST", "/api/upload?name=both.csv", both.encode())
    assert (status, "holds 2 components" in text) == (400, True)
    assert running.request("POST", "/api/upload?name=both.csv&channel=1", both.encode())[0] == 200
    status, text = running.request("POST", "/api/upload?name=bad.txt&unit=m/s2", b"not a record\n")
    assert status == 400
    assert "bad.txt" in text
    assert str(running.server.site.folder) not in text


def test_another_table_says_what_its_columns_could_be_and_how_to_import_it(running) -> None:
    lines = "Zeit [ms];Ventil [V];Weg [mm]\n" + "".join(f"{5 * k};{k % 7};{k % 5}\n" for k in range(100))
    status, text = running.request("POST", "/api/upload?name=rig.csv", lines.encode())
    assert status == 200, text
    told = json.loads(text)["columns"]
    assert "100 rows, 3 columns of numbers, 200 Hz" in told
    assert (
        "./shake import_csv rig.csv --time 'Zeit [ms]' --command 'Ventil [V]' --position 'Weg [mm]' --out rig" in told
    )
    assert not list(running.server.site.folder.rglob("rig*"))


def test_spectator_sees_all_and_changes_nothing(running) -> None:
    with running.page("spectator") as socket:
        assert until(socket, lambda m: m["type"] == "status")["role"] == "spectator"
        for what in ("stop", "enable", "take", "set", "record", "job", "restart", "release"):
            assert "spectators" in ask(socket, what, on=True)["text"]
        assert running.request("POST", "/api/upload?name=a.txt", **running.headers("spectator"))[0] == 400
        assert running.request("GET", "/api/spectators", **running.headers("spectator"))[0] == 400
    assert running.desk.asked == []


def test_one_operator_at_a_time_but_everyone_with_the_token_may_stop(running) -> None:
    with running.page() as first, running.page() as second:
        until(first, lambda m: m.get("role") == "operator")
        assert until(second, lambda m: m["type"] == "status")["role"] == "waiting"
        assert ask(second, "enable", on=True)["text"] == "another page has the controls: take them first"
        assert ask(second, "stop")["ok"]
        assert ask(second, "take")["ok"]
        assert ask(second, "enable", on=True)["ok"]
        assert not ask(first, "enable", on=True)["ok"]
        assert running.server.seat.occupied
    deadline = time.monotonic() + 5.0
    while running.server.seat.occupied and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not running.server.seat.occupied
    assert [what for what, _ in running.desk.asked] == ["stop", "enable"]


@pytest.mark.parametrize(
    "text",
    ["{", "[]", '"stop"', "{}", '{"do": 1}', '{"do": "view", "level": "x"}', '{"do": "between", "level": 1e999}',
     '{"do": "job", "kind": "rm", "learn": ["a"]}', '{"do": "job", "kind": "identify", "learn": ["../x"]}',
     '{"do": "record", "name": "../../etc/x"}', '{"do": "record", "name": "a b"}', '{"do": "__class__"}',
     '{"do": "job", "kind": "identify", "learn": "abc"}', '{"do": "job", "kind": ["identify"], "learn": [1]}'],
)  # fmt: skip
def test_nonsense_is_answered_or_hung_up_on_and_asks_nothing_of_the_graph(running, text) -> None:
    with running.page() as socket:
        until(socket, lambda m: m.get("role") == "operator")
        socket.send(text)
        with contextlib.suppress(ConnectionClosed):
            assert not ask(socket, "nothing")["ok"]
    assert running.desk.asked == []
    with running.page() as socket:
        assert ask(socket, "stop")["ok"]


ASKING = """#!/bin/sh
printf 'release\\t"1.5 mm at 2 Hz"\\n'
read name
echo "moved by ${name:-nobody}"
for out in "$@"; do :; done
mkdir -p "$out/recordings/next_1" && echo '{"open": true}' > "$out/report.json"
echo "recorded: $out/recordings/next_1"
"""


@pytest.mark.parametrize(("released", "by"), [(True, "the operator at the page"), (False, "nobody")])
def test_a_job_moves_the_table_only_once_the_operator_has_released_it(running, monkeypatch, released, by) -> None:
    program = running.server.site.folder / "asking"
    program.write_text(ASKING, encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr("shake_ros.page.jobs.sys.executable", str(program))
    (running.server.site.library.folder / "quake").mkdir()
    (running.server.site.library.folder / "other").mkdir()
    with running.page() as socket:
        until(socket, lambda m: m.get("role") == "operator")
        assert ask(socket, "release", released=True)["text"] == "nothing asks to be released"
        started = ask(socket, "job", kind="decide", learn=["quake"], hold=["other"])
        assert "--next --live --namespace /shake" in started["text"]
        asking = until(socket, lambda m: m.get("jobs") and m["jobs"][0]["asks"])["jobs"][0]
        assert asking["asks"] == "1.5 mm at 2 Hz"
        assert ask(socket, "release", released=released)["ok"]
        job = until(socket, lambda m: m.get("jobs") and m["jobs"][0]["state"] == "done")["jobs"][0]
    assert job["lines"][0] == f"moved by {by}"
    assert running.server.site.library.path("decide_quake_next_1").is_dir()
    assert job["asks"] == ""
    assert job["open"]
    assert job["of"] == {"kind": "decide", "learn": ["quake"], "hold": ["other"], "table": None}


def test_progress_begins_again_with_each_piece_of_work(tmp_path) -> None:
    job = Job(1, ("close_loop",), tmp_path, {})
    job.progress(0.9, "close_loop: verdicts")
    job.progress(0.2, "next_recording: refitting the rivals")
    job.progress(0.1, "next_recording: a motion")
    assert (job.work, job.doing, job.part) == ("next_recording", "a motion", 0.2)


def flood(socket: Any, text: str, count: int) -> None:
    """Send without reading, then read until the other side hangs up."""
    for _ in range(count):
        socket.send(text)
    while True:
        socket.recv(timeout=5)


@pytest.mark.parametrize(
    ("text", "count"),
    [('{"do": "view", "level": 3, "window": 10}', 10_000), ("x" * (1 << 20), 1)],
    ids=["many", "large"],
)
def test_ten_thousand_messages_or_a_huge_one_end_that_page_alone(running, text, count) -> None:
    with running.page() as calm, running.page() as wild:
        with pytest.raises(ConnectionClosed):
            flood(wild, text, count)
        assert ask(calm, "stop")["ok"]


def test_page_that_reads_nothing_costs_nothing_and_goes_on_with_the_newest(running) -> None:
    with running.page(), running.page() as keen:
        ask(keen, "take")
        first = time.monotonic()
        frames = 0
        while time.monotonic() - first < 3.0:
            frames += isinstance(keen.recv(timeout=5), bytes)
        assert frames > 30
    assert threading.active_count() < 40


def test_fifty_pages_are_served_and_a_sixty_fifth_has_to_wait(running) -> None:
    async def crowd() -> tuple[int, int]:
        from websockets.asyncio.client import connect as connect_async

        headers = running.headers()
        many = [
            await connect_async(
                f"ws://{running.host}/live", origin=headers["Origin"], max_size=None, proxy=None,
                additional_headers={"Cookie": headers["Cookie"]},
            )
            for _ in range(64)
        ]  # fmt: skip
        frames = await asyncio.gather(*(_frames(one, 1.5) for one in many))
        refused = 0
        try:
            more = await connect_async(
                f"ws://{running.host}/live", origin=headers["Origin"], proxy=None,
                additional_headers={"Cookie": headers["Cookie"]},
            )  # fmt: skip
            await more.recv()
        except (ConnectionClosed, InvalidStatus):
            refused = 1
        await asyncio.gather(*(one.close() for one in many))
        return min(frames), refused

    least, refused = asyncio.run(crowd())
    assert least >= 1
    assert refused == 1


async def _frames(socket: Any, seconds: float) -> int:
    count, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        count += isinstance(await asyncio.wait_for(socket.recv(), 10), bytes)
    return count


def test_zoom_gets_every_sample_of_a_stretch(running) -> None:
    with running.page() as socket:
        time.sleep(0.5)
        socket.send(json.dumps({"do": "between", "id": 1, "level": 0, "start": 0.05, "stop": 0.15}))
        while not (isinstance(data := socket.recv(timeout=5), bytes) and data.startswith(b"zoom")):
            pass
        _, _, count, _, first, step = HEADER.unpack_from(data, 4)
        assert (count, first, step) == (101, 50.0, 0.001)


def test_page_gets_the_twins_late_prediction_for_what_it_has_already_shown(running) -> None:
    with running.page() as socket:
        while running.store.settled < 600:
            time.sleep(0.01)
        end = 0.0

        def late() -> bool:
            nonlocal end
            data = socket.recv(timeout=10)
            if isinstance(data, str):
                return False
            _, _, n, curves, first, step = HEADER.unpack_from(data)
            low = np.frombuffer(data, np.float32, offset=HEADER.size)[: curves * n].reshape(curves, n)
            again, end = first * step < end, max(end, (first + n) * step)
            return bool(again and np.nanmax(low[ROW["twin_acceleration"]], initial=0.0) == 5.0)

        while end < 0.5:
            late()
        running.store.add("predicted_imu", START + np.arange(100, 400) * MS, np.full((300, 1), 5.0))
        deadline = time.monotonic() + 10.0
        while not late():
            assert time.monotonic() < deadline


def test_spectator_sees_what_the_twin_has_found(running) -> None:
    status, content = running.request("GET", "/api/twin", **running.headers("spectator"))
    assert (status, json.loads(content)) == (200, running.desk.twin())
