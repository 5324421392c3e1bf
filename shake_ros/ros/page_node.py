"""Node `page`: curves, state and controls of the graph in a browser; the web part is shake_ros/page.

All sampled topics are taken in batches. A message that passes through an executor's callback costs 40 µs, 8000 messages
a second a third of a core; taken and decoded in batches they cost a tenth of that.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from shake_ros.page.desk import call_lab
from shake_ros.page.jobs import Jobs
from shake_ros.page.library import Library
from shake_ros.page.samples import TOPICS as SHOWN
from shake_ros.page.samples import Prediction, SampleStore
from shake_ros.page.server import Server, Site
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.recordings.bags.cdr import columns
from shake_ros.recordings.bags.series import SIGNALS
from shake_ros.ros.conversions import time_message
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import Behaviour, Frame, taken
from shake_ros.ros.interface import OPERATOR, TOPICS
from shake_ros.ros.page_desk import PageDesk
from shake_ros.settings import load_table

# Keeps the newest: in real time no writer ever waits for it. In lock-step, where all waits for all, a page whose
# process stands still holds the loop up until it is forgotten (3 s), and costs no sample.
TAP_QOS = QoSProfile(depth=2000)


class SampleTap:
    """Readers on a node of their own, in the namespace of the page's, that no executor serves."""

    def __init__(self, context: Context, namespace: str, store: SampleStore) -> None:
        self.node = Node(
            "_page_samples", namespace=namespace, context=context, start_parameter_services=False, enable_rosout=False
        )
        self._store = store
        self._readers = [
            (name, self.node.create_subscription(TOPICS[name].type, name, lambda _: None, TAP_QOS, raw=True))
            for name in SHOWN
        ]

    def take(self) -> None:
        """Take all that has come."""
        for name, reader in self._readers:
            if messages := [data for data, _ in taken(reader)]:
                signal = SIGNALS[name.removeprefix("predicted_")]
                stamps, values, sources = columns(messages, signal.type, signal.choose, len(signal.paths))
                own = sources >= 0  # messages of other joints on a shared topic are not the table's
                self._store.add(name, stamps[own], values[own])

    def close(self) -> None:
        """Leave the graph."""
        self.node.destroy_node()


FRAME = 1.0 / 30.0  # between two looks at the topics, and at what the page asks for [s]
SIGN = 0.1  # between two signs of the operator's page [s]
LOCAL = "127.0.0.1"


@dataclass(frozen=True)
class PageParameters(Parameters):
    """The node's own settings."""

    address: str = choice("to listen on; others than 127.0.0.1 need a certificate and its key")
    port: int = quantity("-", "0: any that is free", low=0, high=65535)
    certificate: str = choice("of TLS, a PEM file")
    key: str = choice("of the certificate, a PEM file")
    host: str = choice("name of this machine in the page's address, with TLS")
    folder: str = choice("of recordings, uploads and results")
    model: str = choice("table for the page's predictions: of config/table, or a YAML file; empty: none")
    operator_required: bool = quantity(
        "", "report to the table that the operator's page is there; the table holds when this stops"
    )
    lab: str = choice("socket of the lab that started the page; empty: none")


class PageNode(Behaviour):
    """Takes the samples at 30 Hz, settles them, and serves what the page asks for."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        own = frame.settings(PageParameters).value
        if own.address != LOCAL and not (own.certificate and own.key):
            raise ShakeError(f"address {own.address}: beyond {LOCAL} only with certificate and key (TLS)")
        folder = Path(own.folder).absolute()
        (folder / "recordings").mkdir(parents=True, exist_ok=True)
        self._model = load_table(own.model) if own.model else None
        self.store = SampleStore(frame.period, Prediction(frame.sample_time, None))
        library = Library(folder / "recordings")
        self.jobs = Jobs(folder / "results", library.take)
        self._lab = call_lab(own.lab) if own.lab else None
        self.desk = PageDesk(frame, self.store, library, self._lab)
        self.desk.model = own.model
        self._tap = SampleTap(frame.node.context, frame.node.get_namespace(), self.store)
        site = Site(
            self.desk, self.store, library, self.jobs, folder, own.address, own.port, own.certificate, own.key, own.host
        )
        self.server = Server(site)
        frame.every(FRAME, self._take)
        if own.operator_required:
            self._operator = frame.publisher(OPERATOR)
            frame.every(SIGN, self._sign)
        frame.diagnostics.condition = lambda: (OK, f"{self.server.pages} pages open")
        frame.diagnostics.values["pages"] = lambda: self.server.pages

    def start(self) -> None:
        """Serve the page; the model follows once it is compiled."""
        self.server.start()
        threading.Thread(target=self.store.prediction.use, args=(self._model,), daemon=True).start()
        self.frame.say(OK, f"serving {self.server.url.partition('?')[0]}")
        if self._lab:
            self._lab.send({"do": "address", "url": self.server.url})
        else:
            print(f"open {self.server.url}", flush=True)

    def _take(self) -> None:
        self._tap.take()
        self.store.settle()
        self.desk.serve()
        self.frame.diagnostics.cycles += 1

    def _sign(self) -> None:
        """The operator's page is there."""
        if self.server.seat.occupied:
            self._operator.publish(OPERATOR.type(stamp=time_message(self.frame.now())))

    def finish(self) -> None:
        """Hang up; nothing stays behind."""
        self.server.close()
        self.jobs.close()
        self._tap.close()
        if self._lab:
            self._lab.close()


build = PageNode
