"""The desk of the page: requests of the server's thread carried out in the node's, and the state of the graph."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64MultiArray

from shake_ros.page.desk import Answer, Line, TwinHistory, TwinStatus
from shake_ros.page.library import Library
from shake_ros.page.samples import RunMeter, SampleStore, amplitude_spectrum
from shake_ros.quantities import ShakeError
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import LEVELS
from shake_ros.ros.frame import Frame
from shake_ros.ros.graph_client import TABLES, Report, reports_in, values_of
from shake_ros.ros.node_help import RemoteParameters
from shake_ros.settings import find, load_table, read_yaml

SILENT = 3.0  # a node that has not reported for so long is lost [s]
SLOWLY = 15.0  # the same in lock-step, where a busy machine lets a node wait [s]
TRIPS = 60
STOP = interface.STOP.name
SPECTRUM = 8.192  # stretch of the live spectrum [s]
SPECTRUM_EVERY = 0.5  # [s]
ERROR_OVER = 2.0  # stretch of the live comparison with the model [s]
TONE = 3.0  # a fundamental that is so many times the noise is one
LARGEST_THD = 100.0  # [%]
OUTSIDE = ("page", "recorder")  # the loop runs without
MOVES = {"acceleration": 0.3, "velocity": 0.005}  # below [m/s^2], [m/s] rms the noise decides, not the model
GUARDED = ("interlock.", "faults.")  # of the table: the first but for the span, the second only where it is simulated
ALLOWED = ("interlock.span",)
STATES = (  # beginning of the interlock's words → state
    ("hydraulic interlock", "tripped"),
    ("program stop", "tripped"),
    ("stopped", "stopped"),
    ("safe hold", "hold"),
)


def state_of(stage: str, message: str) -> str:
    """The table's state in a word, from what it says on /diagnostics.

    >>> state_of("run", "running"), state_of("off", "hydraulic interlock: position"), state_of("low pressure", "…")
    ('run', 'tripped', 'low pressure')
    """
    return next((state for words, state in STATES if message.startswith(words)), stage or "unknown")


def periodic(thd: dict[str, Any]) -> bool:
    """Whether what the analyzer has fitted is a tone: its fundamental well above harmonics and noise."""
    amplitude, noise = float(thd["fundamental_amplitude_m_s2"]), float(thd["noise_floor_m_s2"])
    return float(thd["thd_percent"]) < LARGEST_THD and amplitude > TONE * noise


class PageDesk:
    """See `shake_ros.page.desk.Desk`."""

    def __init__(self, frame: Frame, store: SampleStore, library: Library, lab: Line | None) -> None:
        self._frame, self._store, self._library, self._lab = frame, store, library, lab
        self.remote = RemoteParameters(frame.node)
        self.runs = RunMeter(store)
        self._requests: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._answers: dict[int, Future[Answer]] = {}
        self.namespace = frame.node.get_namespace()
        self._space = self.namespace.strip("/")
        self._nodes: dict[str, Report] = {}
        self._trips: deque[dict[str, Any]] = deque(maxlen=TRIPS)
        self._thd: dict[str, Any] = {}
        self._harmonics: list[list[float]] = []
        self._twin = TwinHistory()
        self._release = ""
        self._spectrum: dict[str, list[float]] = {}
        self._spectrum_at = 0.0
        self._processes: dict[str, str] = {}
        self._recording, self._recording_since, self._note = "", 0.0, ""
        self._recording_asked = 0.0
        self.model = ""
        node = frame.node
        for topic, heard in (
            (interface.DIAGNOSTICS, self._on_diagnostics),
            (interface.THD, self._on_thd),
            (interface.HARMONICS, self._on_harmonics),
            (interface.TWIN, self._on_twin),
        ):
            node.create_subscription(topic.type, topic.name, heard, topic.qos(frame.lockstep))
        self._services: dict[str, Any] = {
            service.name: node.create_client(service.type, service.name) for service in interface.SERVICES.values()
        }

    # in the node's thread

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for report in reports_in(message, self._space):
            if report.part == "interlock":
                self._trips.append({"at": time.time(), "text": report.message, **report.values})
                continue
            if report.part == "fault":
                self._trips.append({"at": time.time(), "text": f"fault on purpose: {report.message}", "cause": "fault"})
                continue
            if report.part == "release":
                self._release = report.message
                continue
            name = report.node.rpartition("/")[2]
            if name not in self._nodes or time.monotonic() - self._nodes[name].heard > SILENT:
                self.remote.know(name)
            self._nodes[name] = report

    def _on_thd(self, message: DiagnosticArray) -> None:
        self._thd = {**values_of(message.status[0]), "heard": time.monotonic()}

    def _on_harmonics(self, message: Float64MultiArray) -> None:
        self._harmonics = np.asarray(message.data).reshape(-1, 4).tolist()

    def _on_twin(self, message: DiagnosticArray) -> None:
        statuses = [
            TwinStatus(one.name.removeprefix("twin "), LEVELS.index(one.level), one.message, values_of(one))
            for one in message.status
        ]
        self._twin.add(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9, statuses)

    def serve(self) -> None:
        """Carry out what has been asked for; hear what the lab says."""
        while not self._requests.empty():
            self._requests.get()()
        self.remote.serve()
        for message in self._lab.take() if self._lab else ():
            if message["event"] == "processes":
                self._processes = message["processes"]
                self._recorded(message["recording"])
            elif (future := self._answers.pop(message.get("id") or 0, None)) and not future.done():
                future.set_result(Answer(message["ok"], message["text"]))
        self.runs.look(self._words())
        self._look_at_spectrum()

    def _recorded(self, recording: str) -> None:
        if self._recording and not recording:
            words = {"note": self._note, **self._words()}
            if Path(self._recording).parent == self._library.folder:
                self._library.note(Path(self._recording).name, words)
            self._note = ""
        if recording != self._recording:
            self._recording_since, self._recording_asked = self._store.time(), time.monotonic()
        self._recording = recording

    def _records(self) -> bool:
        """Whether the recorder has said that it gets the table's commands."""
        report = self._nodes.get("recorder")
        if report is None or not self._recording or report.heard <= self._recording_asked:
            return False
        counts = f"{interface.VALVE_COMMAND.name}.count"
        return any(name.endswith(counts) and value != "0" for name, value in report.values.items())

    def _look_at_spectrum(self) -> None:
        now = time.monotonic()
        if now - self._spectrum_at < SPECTRUM_EVERY:
            return
        self._spectrum_at = now
        step = self._store.sample_time
        for name in ("acceleration", "reference_acceleration"):
            frequency, amplitude = amplitude_spectrum(self._store.newest(name, SPECTRUM), step)
            self._spectrum[name] = [float(f"{value:.4g}") for value in amplitude]
        self._spectrum["frequency"] = [float(f"{value:.5g}") for value in frequency]

    # for the server

    def _words(self) -> dict[str, str]:
        """What runs: by the nodes' own parameters."""
        asked = {"reference": "reference_generator", "controller": "controller", "observer": "observer"}
        found = {name: self.remote.value(node, name) for name, node in asked.items()}
        found["table"] = self.remote.value("plant", "table") or self.remote.value("hardware_bridge", "bridge")
        return {name: str(value) for name, value in found.items() if value is not None}

    def _model_error(self) -> dict[str, float]:
        """Measured against predicted over the last seconds, relative to the measured: rms of the difference."""
        found = {}
        for name, measured in (("acceleration", "acceleration"), ("velocity", "estimated_velocity")):
            is_, said = (self._store.newest(one, ERROR_OVER) for one in (measured, f"predicted_{name}"))
            both = np.isfinite(is_) & np.isfinite(said)
            spread = float(np.std(is_[both])) if both.sum() > 100 else 0.0
            if spread > MOVES[name]:
                found[name] = float(np.sqrt(np.mean((is_[both] - said[both]) ** 2)) / spread)
        return found

    def status(self) -> dict[str, Any]:
        """See `Desk`."""
        now = time.monotonic()
        silent = SLOWLY if self._frame.lockstep else SILENT
        nodes = {}
        for name, one in sorted(self._nodes.items()):
            if name == "recorder" and self._lab and not self._recording and name not in self._processes:
                continue
            age = now - one.heard
            nodes[name] = {**vars(one), "age": age, "lost": age > silent}
        table = next((nodes[name] for name in TABLES if name in nodes), None)
        stage = table["values"].get("stage", "") if table else ""
        died = {name: why for name, why in self._processes.items() if why}
        if table is None:
            state, message = self._before_the_table(died)
        elif table["lost"]:
            state, message = "lost", f"silent for {table['age']:.0f} s; its last message was: {table['message']}"
        else:
            state, message = state_of(stage, table["message"]), table["message"]
        thd = self._thd if self._thd and now - self._thd["heard"] < SILENT and periodic(self._thd) else {}
        runs = [{k: v for k, v in run.items() if k not in ("spectrum", "wanted", "periods")} for run in self.runs.runs]
        return {
            "epoch": self._store.epoch, "time": self._store.time(), "sample_time": self._store.sample_time,
            "nodes": nodes, "state": state, "stage": stage, "message": message,
            "level": table["level"] if table else 2, "span": table["values"].get("span", "") if table else "",
            "trips": list(self._trips), "thd": thd, "harmonics": self._harmonics if thd else [],
            "spectrum": self._spectrum, "runs": runs, "last_run": self.runs.runs[-1] if runs else None,
            "model_error": self._model_error(), "model": self.model, "words": self._words(), "died": died,
            "processes": list(self._processes), "recording": self._recording, "records": self._records(),
            "lab": self._lab is not None,
            "recording_for": max(0.0, self._store.time() - self._recording_since) if self._recording else 0.0,
            "released": self.remote.value("twin", "release"), "release": self._release,
            "play": self.remote.value("reference_generator", "play"),
            "repeat": self.remote.value("reference_generator", "repeat"), "lockstep": self._frame.lockstep,
        }  # fmt: skip

    def _before_the_table(self, died: dict[str, str]) -> tuple[str, str]:
        """State and message while no table has reported yet."""
        if died:
            return "lost", "no table"
        missing = [name for name in self._processes if name not in self._nodes and name not in OUTSIDE]
        return "starting", f"waiting for {', '.join(missing) or 'the table'}; the first start compiles for a minute"

    def parameters(self) -> dict[str, list[dict[str, Any]]]:
        """See `Desk`."""
        return {
            node: [{**one, "live": one["live"] and not self._guarded(node, one["name"])} for one in found]
            for node, found in self.remote.nodes.items()
        }

    def twin(self) -> dict[str, Any]:
        """See `Desk`."""
        return self._twin.content

    def _guarded(self, node: str, name: str) -> bool:
        """Whether a parameter is out of the page's reach: what the interlock watches is not loosened by a click."""
        simulated = node == "plant" and name.startswith("faults.")
        return node in TABLES and name.startswith(GUARDED) and name not in ALLOWED and not simulated

    def ask(self, what: str, **how: Any) -> Future[Answer]:
        """See `Desk`."""
        future: Future[Answer] = Future()
        if what in ("table", "model"):
            threading.Thread(target=self._long, args=(future, what, how), daemon=True).start()
        elif what == STOP:  # waits for no look of the node
            self._do(future, what, how)
        else:
            self._requests.put(lambda: self._do(future, what, how))
        return future

    def _do(self, future: Future[Answer], what: str, how: dict[str, Any]) -> None:
        try:
            if what in self._services:
                self._call(future, what, how)
            elif what == "set":
                if self._guarded(str(how["node"]), str(how["name"])):
                    raise ShakeError(
                        f"{how['name']} belongs to the interlock: it can be changed only where the table is started"
                    )
                self.remote.set(str(how["node"]), str(how["name"]), how["value"], future)
            elif what == "record":
                self._note = how["note"]
                self._ask_lab(future, what, {"name": how["name"]})
            elif what in ("restart", "stop_recording", "replace"):
                self._ask_lab(future, {"replace": "table"}.get(what, what), {"name": str(how.get("name", ""))})
            else:
                raise ShakeError(f"{what}: unknown")
        except (ShakeError, KeyError) as error:
            future.set_result(Answer(False, str(error)))

    def _call(self, future: Future[Answer], what: str, how: dict[str, Any]) -> None:
        client = self._services[what]
        if not client.service_is_ready():
            raise ShakeError(f"{what}: the table does not answer")
        request = client.srv_type.Request()
        if what == "enable":
            request.data = bool(how["on"])

        def answered(done: Any) -> None:
            if not future.done():
                future.set_result(Answer(bool(done.result().success), str(done.result().message)))

        client.call_async(request).add_done_callback(answered)

    def _ask_lab(self, future: Future[Answer], what: str, how: dict[str, Any]) -> None:
        if self._lab is None or not self._lab.open:
            raise ShakeError(f"{what}: only if ./shake lab has started the page")
        number = len(self._answers) + time.monotonic_ns() % 10**9
        self._answers[number] = future
        self._lab.send({"do": what, "id": number, **how})

    def _long(self, future: Future[Answer], what: str, how: dict[str, Any]) -> None:
        """Use a table: predict with it, and give it to observer, controller and simulated plant."""
        try:
            path = str(how["path"])
            self._store.prediction.use(load_table(path))
            self.model = path
            done = ["prediction"]
            if what == "table":
                done += [name for name in ("observer", "controller") if how.get(name) and self._hand_over(name, path)]
                if how.get("plant"):
                    answer = self.ask("replace", name=path).result(60.0)
                    if not answer.done:
                        raise ShakeError(answer.text)
                    done.append("simulated table")
            future.set_result(Answer(True, f"{path} is used by {', '.join(done)}"))
        except (ShakeError, KeyError, OSError) as error:
            future.set_result(Answer(False, str(error)))
        except TimeoutError:
            future.set_result(Answer(False, f"{what}: no answer"))

    def _hand_over(self, kind: str, path: str) -> bool:
        """Observer or controller with another table: as `--tune` made it beside the table, else the present one."""
        tuned = Path(path).with_name(f"{kind}.yaml")
        if not tuned.is_file():
            content = read_yaml(find(kind, str(self.remote.value(kind, kind))))
            if kind == "observer" and "model" not in content:
                content = read_yaml(find(kind, "model"))
            tuned = Path(path).with_name(f"{kind}_{content['kind']}.yaml")
            if "/" not in path:
                tuned = self._library.folder.parent / "uploads" / f"{kind}_{content['kind']}_{path}.yaml"
                tuned.parent.mkdir(parents=True, exist_ok=True)
            tuned.write_text(yaml.safe_dump({**content, "model": path}, sort_keys=False), encoding="utf-8")
        answer = self.ask("set", node=kind, name=kind, value=str(tuned)).result(60.0)
        if not answer.done:
            raise ShakeError(f"{kind}: {answer.text}")
        return True
