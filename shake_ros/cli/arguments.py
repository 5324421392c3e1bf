"""What commands share: options, the recordings and the model that they name, the live table, the line in a report."""

from __future__ import annotations

import argparse
import inspect
import json
import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin

from shake_ros.api.fitted import check_apart
from shake_ros.api.live_table import LiveTable
from shake_ros.api.model import Model, model
from shake_ros.api.progress import FOLLOWED
from shake_ros.api.read import Recordings, read
from shake_ros.declared import DEFAULT_TABLE, MODELS
from shake_ros.entry_points import ENTRY_POINTS
from shake_ros.fit.start.unknown_model import NAME as UNKNOWN
from shake_ros.page.jobs import RELEASE
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags.bag import SUFFIXES
from shake_ros.report.chart import FORMATS
from shake_ros.report.page import Result
from shake_ros.result_folder import check_folder

CHOSEN = ("joint", "publishers", "covariance", "clock")  # kinds of findings on what was read in place of what


class CommandLine(argparse.ArgumentParser):
    """The command line of one command: the options of its verb, and those that several commands have.

    Parameters
    ----------
    name : of its entry point, whose line says what it does.
    method : how it does it, below the options; its lines are kept as they are.
    """

    def __init__(self, name: str, method: str = "") -> None:
        line = ENTRY_POINTS[name].line
        description = f"{line[0].upper()}{line[1:]}."
        super().__init__(
            name, description=description, epilog=method, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        self._of_verb: list[str] = []

    def add_verb(self, verb: Callable[..., Any], *left_out: str, **renamed: str) -> None:
        """An option for each parameter with a default, of the type of its annotation, explained by the docstring.

        Parameters
        ----------
        verb : whose parameters these are. What a line of text cannot give has no option.
        left_out : parameters without an option.
        renamed : options by parameter, where their names differ.
        """
        texts = parameter_texts(verb)
        for name, parameter in inspect.signature(verb, eval_str=True).parameters.items():
            form = _form(parameter.annotation)
            if parameter.default is parameter.empty or form is None or name in left_out:
                continue
            word = renamed.get(name, name)
            if "type" in form:
                form.setdefault("metavar", word.upper())
            text = texts[name].removesuffix(".").replace(" [-]", "").replace("%", "%%")
            default = parameter.default
            text += _default_text(default)
            self.add_argument(f"--{word.replace('_', '-')}", dest=name, default=default, help=text, **form)
            self._of_verb.append(name)

    def options(self, given: argparse.Namespace) -> dict[str, Any]:
        """What the verb is called with, by parameter."""
        found = {name: getattr(given, name) for name in self._of_verb}
        return {**found, "set": changes(given)} if "set" in found else found

    def read(self, arguments: Sequence[str]) -> argparse.Namespace:
        """The arguments; `line` among them is the whole command line, for a report."""
        given = self.parse_args(arguments)
        given.line = shlex.join(["./shake", self.prog, *map(str, arguments)])
        return given

    def add_folder(self, text: str) -> None:
        """The options --out and --force of a result folder."""
        self.add_argument("--out", type=Path, required=True, metavar="DIR", help=text)
        self.add_argument("--force", action="store_true", help="replace an existing DIR")

    def add_figures(self) -> None:
        """The option --figures."""
        self.add_argument("--figures", choices=FORMATS, help="also write the report's charts as files")

    def add_recordings(self, **more: Any) -> None:
        """The recordings that are read, BAG, and the option --take."""
        self.add_argument("bags", metavar="BAG", type=Path, **more)
        self.add_take()

    def add_take(self) -> None:
        """The option --take."""
        self.add_argument(
            "--take",
            action="append",
            default=[],
            metavar="SIGNAL=WHAT",
            help="where a recording has several of a signal, the one to read: a topic (/…), the name of a joint or the "
            "number of a publisher, as joint_states=x_axis; repeatable",
        )

    def add_set(self, text: str, metavar: str = "KEY=VALUE") -> None:
        """The option --set, which may be repeated."""
        self.add_argument("--set", help=text, nargs="+", action="extend", metavar=metavar)

    def add_live(self) -> None:
        """The options --live and --namespace."""
        self.add_argument("--live", action="store_true", help="move the table of the running graph, which is enabled")
        self.add_argument(
            "--namespace", default="/shake", metavar="NS", help="with --live: namespace of the graph (default: /shake)"
        )


def _form(annotation: Any) -> dict[str, Any] | None:
    """How a parser takes values of a type; None where a line of text cannot give them."""
    kinds = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
    if Recordings in kinds:  # the options of `add_data`
        return None
    if str in kinds:
        return {"type": str}
    for kind, metavar in ((int, "N"), (float, "X")):
        if kind in kinds:
            return {"type": kind, "metavar": metavar}
    if kinds == (bool,):
        return {"action": "store_true"}
    for kind in kinds:
        if get_origin(kind) is Mapping:
            return {"action": "extend", "nargs": "+", "metavar": "KEY=VALUE"}
        if get_origin(kind) is Sequence:
            form = _form(get_args(kind)[0])
            return form and {**form, "nargs": "+"}
    return None


def _default_text(default: Any) -> str:
    values = default if isinstance(default, tuple) else (default,)
    text = ", ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in values)
    return f" (default: {text})" if text not in ("", "None", "False") else ""


def parameter_texts(verb: Callable[..., Any]) -> dict[str, str]:
    """What the section Parameters of a docstring says of each parameter."""
    section = (inspect.getdoc(verb) or "").partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    texts, names = dict[str, str](), list[str]()
    for line in section.splitlines():
        if line.startswith(" "):
            texts |= {name: f"{texts[name]} {line.strip()}" for name in names}
        else:
            head, _, text = line.partition(" : ")
            names = head.split(", ")
            texts |= dict.fromkeys(names, text)
    return texts


def changes(given: argparse.Namespace) -> dict[str, float]:
    """Names and values that --set changes."""
    found = {}
    for text in given.set or ():
        key, _, value = text.partition("=")
        try:
            found[key] = float(value)
        except ValueError:
            raise ShakeError(f"--set {text}: expected KEY=NUMBER") from None
    return found


def reporting(given: argparse.Namespace) -> dict[str, Any]:
    """What a result's `report` takes beside its folder."""
    return {"figures": given.figures, "command": given.line}


def reported(found: Result, given: argparse.Namespace) -> int:
    """Write a result into its folder and print it; the exit code."""
    found.report(given.out, given.force, **reporting(given))
    print(found)
    print(f"report: {given.out / found.page_name}.html")
    return 0


def taken(given: argparse.Namespace) -> dict[str, list[str | int]]:
    """What --take names, by signal."""
    found: dict[str, list[str | int]] = {}
    for text in given.take:
        name, equals, what = text.partition("=")
        if not (equals and what):
            raise ShakeError(f"--take {text}: expected SIGNAL=WHAT, as joint_states=x_axis")
        found.setdefault(name, []).append(what)
    return found


def source(path: Path, given: argparse.Namespace) -> Recordings | Path:
    """A recording, whose choice of topic, joint, publisher and clock goes to standard error; or another file's path."""
    if path.is_file() and not path.name.endswith(SUFFIXES):
        return path
    runs = read(path, take=taken(given))
    for recording in runs:
        for finding in recording.findings:
            if finding.kind in CHOSEN:
                print(f"{recording.name}: {finding}", file=sys.stderr)
    return runs


def add_data(command: CommandLine, needed: Sequence[str] = ()) -> None:
    """The recordings, of which some are needed ("estimation", "validation"), and the result folder."""
    for name, short, text in (
        ("estimation", "learn", "recordings to fit"),
        ("validation", "hold", "recordings that are not fitted: validation data"),
    ):
        options = (f"--{short}", f"--{name}")
        command.add_argument(
            *options, dest=name, type=Path, nargs="+", required=name in needed, default=[], metavar="BAG", help=text
        )
    command.add_take()
    command.add_folder("folder for the results")
    command.add_figures()


def add_declared(command: CommandLine) -> None:
    """The declared model."""
    command.add_argument(
        "--model", choices=sorted([*MODELS, UNKNOWN]), default="full", help="declared model (default: full)"
    )
    command.add_argument(
        "--config",
        metavar="FILE",
        help="declared table: a name of config/table or a YAML file "
        f"(default: {DEFAULT_TABLE}; `unknown`: no data sheet; models other than full start from the recordings)",
    )
    command.add_set("change a declared value")


def inputs(given: argparse.Namespace) -> tuple[Model, Recordings, Recordings]:
    """Model, estimation and validation data of the arguments; their data checks go to standard error."""
    check_folder(given.out, given.force)
    declared = model(given.model, given.config, changes(given))
    estimation, validation = read_data(given)
    check_apart(estimation, validation)
    if declared.declared.driven_by == "valve_command":
        for line in [*(estimation + validation).data_checks, *declared.contradictions(estimation)]:
            print(line, file=sys.stderr)
    for note in declared.notes:
        print(note, file=sys.stderr)
    return declared, estimation, validation


def read_data(given: argparse.Namespace) -> tuple[Recordings, Recordings]:
    """Estimation and validation data of the arguments; what reading met goes to standard error."""
    return read_set(given, given.estimation), read_set(given, given.validation)


def read_set(given: argparse.Namespace, bags: Sequence[Path]) -> Recordings:
    """Recordings of one set; what reading met goes to standard error."""
    found = read(*bags, take=taken(given))
    for finding in found.findings:
        print(finding, file=sys.stderr)
    return found


@contextmanager
def live(given: argparse.Namespace) -> Iterator[LiveTable | None]:
    """The live table where one is asked for; ShakeError where there is no graph, or none that may move."""
    if not given.live:
        yield None
        return
    try:
        from shake_ros.ros.live_table import live_table
    except ImportError as error:
        raise ShakeError(f"--live: needs ROS 2 ({error})") from None
    before = {number: signal.signal(number, _interrupted) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with live_table(given.namespace) as table:
            yield table
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupted(*_: object) -> None:
    """Ctrl-C, or the end of the command from outside: what plays comes to rest, what was set is set back."""
    raise KeyboardInterrupt


def released_by(state: str, name: str) -> str:
    """Who releases the described motion; empty where nobody does or nobody is there.

    Where no name is given it is asked at the terminal; of a process that follows this one, on a line of its own, which
    it answers on standard input.
    """
    print(state, flush=True)
    if name:
        return name
    if FOLLOWED:
        print(f"{RELEASE}\t{json.dumps(state)}", flush=True)
        return sys.stdin.readline().strip()
    return input("released by (empty: stop here): ").strip() if sys.stdin.isatty() else ""
