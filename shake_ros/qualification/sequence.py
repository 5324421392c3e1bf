"""A sequence of qualification tests: levels in turn, each test acknowledged; resumed where it stopped.

Every test leaves a folder of its own with its certificate, written whole or not at all; a later call reads
the finished ones from their recordings. sequence.json holds what was asked and who released which test.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.api.live_table import LiveLaboratory, LiveTable, own_loop
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.simulate import Simulation
from shake_ros.commissioning.steps import watched
from shake_ros.qualification.asked import Asked, asked_of
from shake_ros.qualification.qualify import Laboratory, SimulatedLaboratory, conduct, made_motion
from shake_ros.qualification.resonance import ResonanceSearch, Shift
from shake_ros.qualification.result import Qualification, certified, moved
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.recordings.bags import read_table_recording
from shake_ros.result_folder import write_json, writing
from shake_ros.settings import find, load_content, read_yaml

PLANS = "qualification_sequences"
KEYS = ("name", "source", "levels", "interlock")


@dataclass(frozen=True)
class Level(Parameters):
    """Tests of one level."""

    name: str = choice("of the level, a part of a folder's name")
    share: float = quantity("-", "of the required spectrum", low=0.01, high=1.0)
    tests: int = quantity("-", "how many", low=1, high=100)


@dataclass(frozen=True)
class Stage:
    """One test of a plan: its name, share of the spectrum, and whether resonances are sought before and after it."""

    name: str
    share: float
    searches: tuple[bool, bool]


@dataclass(frozen=True)
class Plan:
    """Content of config/qualification_sequences."""

    name: str
    source: str
    levels: tuple[Level, ...]
    interlock: str

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Its tests in turn; resonances are sought before the first one and after each level."""
        found = [
            (f"{number}_{level.name}_{k + 1}", level.share, k + 1 == level.tests)
            for number, level in enumerate(self.levels, start=1)
            for k in range(level.tests)
        ]
        return tuple(Stage(name, share, (k == 0, last)) for k, (name, share, last) in enumerate(found))


def load_plan(name: str) -> Plan:
    """config/qualification_sequences/<name>.yaml, or a YAML file; ShakeError for wrong content."""
    content, path = load_content(PLANS, name, KEYS)
    if not isinstance(content["levels"], list) or not content["levels"]:
        raise ShakeError(f"{path}: levels: a list of {{name, share, tests}} is needed")
    levels = tuple(Level.from_mapping(row, f"{path}: level {k}") for k, row in enumerate(content["levels"], start=1))
    for level in levels:
        if not level.name.replace("_", "").isalnum():
            raise ShakeError(f"{path}: level '{level.name}': letters, digits and _ make a folder's name")
    find("interlock", str(content["interlock"]))
    return Plan(str(content["name"]), str(content["source"]), levels, str(content["interlock"]))


FILE, SCHEMA = "sequence.json", "shake_ros.qualify_sequence/1"


@dataclass(frozen=True)
class StageDone:
    """A test of a sequence: its result, the interlock's message (empty: clear), who released it and when."""

    stage: Stage
    test: Qualification
    interlock: str
    by: str
    date: str


@dataclass(frozen=True, repr=False)
class TestSequence:
    """The finished tests of a sequence."""

    __test__ = False  # no test of pytest

    plan: Plan  # what was asked
    done: tuple[StageDone, ...]  # tests in turn
    waiting: str = ""  # what is to be acknowledged next; empty where nothing is

    @property
    def before(self) -> ResonanceSearch | None:
        """The search before the first test."""
        return self.done[0].test.before if self.done else None

    def shifts(self, done: StageDone) -> tuple[Shift, ...]:
        """The change of each resonance from before the first test until after this one."""
        after = done.test.after
        return () if self.before is None or after is None else self.before.shifts(after)

    @property
    def reason(self) -> str:
        """Why it ended before its last test or did not pass; empty where it did not, or only waits."""
        for done in self.done:
            why = done.test.reason or moved(self.shifts(done), done.test.shift)
            why = why or (f"interlock: {done.interlock}" if done.interlock else "")
            if why or not done.test.passed:
                return f"{done.stage.name}: {why or 'a rule does not hold'}"
        return ""

    @property
    def passed(self) -> bool:
        """Whether every test of the plan was run and passed, and no resonance moved."""
        return len(self.done) == len(self.plan.stages) and not self.reason

    def content(self) -> dict[str, Any]:
        """Its part of sequence.json with the result."""
        rows = []
        for done in self.done:
            ratio = done.test.assessment.ratio
            rows.append(
                {
                    "test": done.stage.name,
                    "share": done.stage.share,
                    "released_by": done.by,
                    "date": done.date,
                    "runs": len(done.test.runs),
                    "passed": done.test.passed,
                    "lowest": float(ratio.min()),
                    "largest": float(ratio.max()),
                    "interlock": done.interlock,
                    "resonance": "" if done.test.after is None else str(done.test.after),
                    "shifts": [str(shift) for shift in self.shifts(done)],
                }
            )
        before = "" if self.before is None else str(self.before)
        header = {"name": self.plan.name, "source": self.plan.source, "resonance_before": before, "tests": rows}
        return {**header, "passed": self.passed, "reason": self.reason, "waiting": self.waiting}


def qualify_sequence(
    required: str | Path,
    folder: str | Path,
    acknowledge: Callable[[str], str],
    table: str | Path = "bergamo",
    *,
    plan: str = "five_and_one",
    model: str | Path | None = None,
    rules: str | None = None,
    scale: float = 1.0,
    set: Mapping[str, float] | None = None,  # noqa: A002 (as of `qualify`)
    settings: str = "default",
    runs: int | None = None,
    seed: int = 0,
    delay: int = 0,
    specimen: str = "",
    live: LiveTable | None = None,
    progress: ProgressOption = True,
) -> TestSequence:
    """Run the tests of a plan that are not in the folder yet, each after its acknowledgement.

    Parameters
    ----------
    folder : where each test leaves its certificate.
    acknowledge : is called with the state and the next test, and returns who releases it; empty text ends the call, and
        a later one continues from there.
    plan : a name of config/qualification_sequences or a file. The others as of `qualify`; the same in every call.

    Raises
    ------
    ShakeError
        As of `qualify`; a folder that was begun with other arguments, or whose certificates are not reproduced.
    """
    chosen, top = load_plan(plan), Path(folder)
    asked = asked_of(
        required,
        table,
        model=model,
        rules=rules,
        scale=scale,
        set=set,
        settings=settings,
        refit=None,
        runs=runs,
        specimen=specimen,
        seed=seed,
        live=live,
    )
    named: dict[str, Any] = {"required": str(required), "plan": plan, "rules": rules, "scale": scale}
    named |= {"set": dict(set or {}), "table": str(table), "model": model and str(model), "settings": settings}
    named |= {"runs": runs, "delay": delay, "seed": seed, "specimen": specimen, "live": live is not None}
    log = _Log.opened(top, named)
    found = TestSequence(chosen, log.done(chosen))
    lasting = None if live is None else LiveLaboratory(live, late=delay * asked.sample_time)
    with Progress("qualify", progress) as bar:
        motion = made_motion(asked, seed)  # of the full level, which has to fit before anything moves
        for number, stage in list(enumerate(chosen.stages))[len(found.done) :]:
            if found.reason:
                break
            state = _announced(found, stage)
            by = acknowledge(state)
            if not by:
                found = replace(found, waiting=state)
                break
            date = log.released(stage, by)
            drive = stage.share * motion if not found.done else _drive_of(found.done[-1], stage)
            bar(f"{stage.name}, released by {by}", number / len(chosen.stages))
            laboratory = _laboratory(asked, lasting, delay, 100 * seed + number)
            now = replace(asked, required=asked.required.scaled(stage.share))
            if live is not None:
                now = replace(now, about={**now.about, "released by": by})
            test = conduct(now, laboratory, drive, seed, lambda text, _: bar(text, 0.0), stage.searches)
            test.report(top / stage.name)
            held = log.ended(stage, len(test.runs), chosen)
            found = replace(found, done=(*found.done, StageDone(stage, test, held, by, date)))
            log.written(found)
    log.written(found)
    return found


def sequence_of(folder: str | Path) -> tuple[TestSequence, tuple[str, ...]]:
    """A sequence from its folder, all its certificates computed again, and the figures that differ."""
    log, differences = _Log.read(Path(folder)), list[str]()
    plan = load_plan(str(log.content["asked"]["plan"]))
    return TestSequence(plan, log.done(plan, differences)), tuple(differences)


def _drive_of(done: StageDone, stage: Stage) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The drive that passed the test before, at the share of the next one."""
    return np.asarray(done.test.runs[-1].drive * (stage.share / done.stage.share))


def _announced(found: TestSequence, stage: Stage) -> str:
    """The state of the sequence and the test that is to be released."""
    count, number = len(found.plan.stages), len(found.done) + 1
    text = f"next: {stage.name}, test {number} of {count}, {100.0 * stage.share:g} % of the required spectrum"
    if not found.done:
        return f"{text}; before it: resonance search"
    last = found.done[-1]
    searched = "" if last.test.after is None else f", resonances after it: {last.test.after}"
    return f"{text}; before it: {last.stage.name} passed, interlock {last.interlock or 'clear'}{searched}"


def _laboratory(asked: Asked, lasting: LiveLaboratory | None, delay: int, seed: int) -> Laboratory:
    """What plays a test: the simulated table with noise of its own, or the live one, whose recordings begin anew."""
    own = own_loop(asked.model) if asked.makes_loop else None
    if lasting is None:
        return SimulatedLaboratory(asked.table, asked.settings, delay, seed, own, [])
    lasting.own, lasting.recordings, lasting.missing = own, [], {}
    return lasting


@dataclass
class _Log:
    """sequence.json."""

    path: Path
    content: dict[str, Any]

    @classmethod
    def read(cls, top: Path) -> _Log:
        """That of a folder."""
        path = top / FILE
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            assert content["schema"] == SCHEMA and content["asked"] and isinstance(content["tests"], dict)
        except (OSError, ValueError, KeyError, TypeError, AssertionError):
            raise ShakeError(f"{path}: is not a sequence of ./shake qualify") from None
        return cls(path, content)

    @classmethod
    def opened(cls, top: Path, asked: dict[str, Any]) -> _Log:
        """That of a folder that may be new; ShakeError where another sequence lies there."""
        if not top.exists():
            with writing():
                top.mkdir(parents=True)
                found = cls(top / FILE, {"schema": SCHEMA, "asked": asked, "tests": {}})
                write_json(found.path, found.content)
            return found
        found = cls.read(top)
        for name, value in asked.items():
            before = found.content["asked"].get(name, False if name == "live" else None)
            if before != value:
                raise ShakeError(f"{found.path}: was begun with {name} = {before}, now it is {value}")
        return found

    def done(self, plan: Plan, differences: list[str] | None = None) -> tuple[StageDone, ...]:
        """The tests that ended, from their recordings.

        What differs from a certificate is added to `differences`; without such a list it is an error.
        """
        rows, top = [], self.path.parent
        for stage in plan.stages:
            row = self.content["tests"].get(stage.name)
            if row is None or not (top / stage.name).is_dir():
                break
            test, found = certified(top / stage.name)
            if found and differences is None:
                raise ShakeError(f"{top / stage.name}: {found[0]}")
            if differences is not None:
                differences += [f"{stage.name}: {line}" for line in found]
            held = row["interlock"] if "interlock" in row else self.ended(stage, len(test.runs), plan)
            rows.append(StageDone(stage, test, held, row["released_by"], row["date"]))
        return tuple(rows)

    def released(self, stage: Stage, by: str) -> str:
        """Who released a test, written before it moves; returns when."""
        now = datetime.now(timezone.utc).isoformat(timespec="seconds")
        self.content["tests"][stage.name] = {"released_by": by, "date": now}
        write_json(self.path, self.content)
        return now

    def ended(self, stage: Stage, runs: int, plan: Plan) -> str:
        """What the interlock says to the last run of a test whose folder is written."""
        last = read_table_recording(self.path.parent / stage.name / "recordings" / f"run_{runs}")
        held = watched(Simulation(last), read_yaml(find("interlock", plan.interlock)))[0]
        self.content["tests"][stage.name]["interlock"] = held
        write_json(self.path, self.content)
        return held

    def written(self, found: TestSequence) -> None:
        """sequence.json and sequence.html of what there is."""
        from shake_ros.qualification.certificate import sequence_page

        self.content["result"] = found.content()
        with writing():
            write_json(self.path, self.content)
            self.path.with_suffix(".html").write_text(sequence_page(found.content()), encoding="utf-8")
