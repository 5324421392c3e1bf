"""The result of `qualify`: runs, verdicts, certificate; and the same again from its recordings."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.qualification.assessment import Rules, SpectrumAssessment, Tested, tested
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.qualification.resonance import Resonance, ResonanceSearch, SearchBand, Shift
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording, read_table_recording, write_table_recording
from shake_ros.report.chart import static_figure
from shake_ros.report.result_table import ResultTable
from shake_ros.result_folder import new_folder, write_json, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCHEMA = "shake_ros.qualify/2"
SIGNALS = ("pressure_a", "pressure_b", "pressure_supply", "reference")


@dataclass(frozen=True, repr=False)
class Qualification:
    """A test with its verdicts.

    Attributes
    ----------
    required, rules : the spectrum and the code.
    runs : oldest first.
    reason : why it did not pass; empty where it did.
    sample_time : [s].
    about : specimen, table, instruments, date, … recordings : of searches and runs, in turn.
    before, after : resonance searches; None where there was none.
    shift : of a resonance, from which it counts [-].
    per_octave : frequencies of an octave over which the error of a run is.
    search : where a resonance was sought.
    """

    required: RequiredSpectrum
    rules: Rules
    runs: tuple[Tested, ...]
    reason: str
    sample_time: float
    about: dict[str, str]
    recordings: tuple[TableRecording, ...] = ()
    before: ResonanceSearch | None = None
    after: ResonanceSearch | None = None
    shift: float = 0.1
    per_octave: int = 12
    search: SearchBand | None = None

    @property
    def assessment(self) -> SpectrumAssessment:
        """Of the last run."""
        return self.runs[-1].assessment

    @property
    def shifts(self) -> tuple[Shift, ...]:
        """What became of each resonance; empty without two searches."""
        return () if self.before is None or self.after is None else self.before.shifts(self.after)

    @property
    def moved(self) -> str:
        """What the searches say of the specimen; empty where none of its resonances moved."""
        return moved(self.shifts, self.shift)

    @property
    def passed(self) -> bool:
        """Whether every rule holds and the specimen's resonance did not move."""
        return not self.reason and self.assessment.passed and not self.moved

    @property
    def error(self) -> ResultTable:
        """The runs: spectrum missed, lowest and largest TRS/RRS."""
        rows = [
            (
                k + 1,
                100.0 * run.error,
                float(run.assessment.ratio.min()),
                float(run.assessment.ratio.max()),
                run.assessment.passed,
            )
            for k, run in enumerate(self.runs)
        ]
        columns = ("run", "spectrum missed [%]", "lowest TRS/RRS", "largest TRS/RRS", "passed")
        ratios = dict.fromkeys(columns[2:4], "{:.3f}".format)
        shown = {columns[1]: "{:.1f}".format, "passed": lambda passed: "passed" if passed else "not passed", **ratios}
        return ResultTable(columns, rows, shown)

    @property
    def verdicts(self) -> ResultTable:
        """The rules of the last run."""
        word = {True: "pass", False: "FAIL", None: "reported"}
        rows = [(v.rule, v.asked, v.measured, word[v.passed]) for v in self.assessment.verdicts]
        return ResultTable(("rule", "asked", "measured", ""), rows)

    def __repr__(self) -> str:
        from shake_ros.qualification.certificate import certificate_page

        return certificate_page(self).text()

    def plot(self) -> Figure:
        """Required and test response spectrum, motion and convergence."""
        from shake_ros.qualification.certificate import charts

        return static_figure(*charts(self))

    def content(self, sums: dict[str, str]) -> dict[str, Any]:
        """certificate.json."""
        found = {n: None if r is None else asdict(r) for n, r in (("before", self.before), ("after", self.after))}
        f, levels = self.required.frequencies, self.required.levels
        return {
            "schema": SCHEMA,
            "passed": self.passed,
            "reason": self.reason or self.moved,
            "about": self.about,
            "required": {**asdict(self.required), "frequencies": f.tolist(), "levels": levels.tolist()},
            "rules": asdict(self.rules),
            "runs": [{"error": run.error, **run.assessment.content()} for run in self.runs],
            "per_octave": self.per_octave,
            "search": None if self.search is None else {**asdict(self.search), "shift": self.shift},
            "resonance": found,
            "resonance_shifts": [
                {
                    "before": p.before and asdict(p.before),
                    "after": p.after and asdict(p.after),
                    "frequency": p.frequency,
                    "damping": p.damping,
                }
                for p in self.shifts
            ],
            "sha256": sums,
        }

    def report(self, folder: str | Path, force: bool = False) -> Path:
        """Write certificate.html, .pdf and .json and the recordings; `force` replaces an existing folder."""
        out = Path(folder)
        with new_folder(out, force=force) as work:
            for run in self.recordings:
                signals: Any = {name: getattr(run, name) for name in SIGNALS}
                write_table_recording(
                    work / "recordings" / run.name,
                    run.time,
                    run.valve_command,
                    run.position,
                    run.acceleration,
                    **signals,
                )
            self.certify(work, checksums(work / "recordings"))
        return out

    def certify(self, folder: Path, sums: dict[str, str]) -> None:
        """Write the certificate alone."""
        from shake_ros.qualification.certificate import certificate_pages

        with writing():
            write_json(folder / "certificate.json", self.content(sums))
            certificate_pages(self, sums, folder)


def certified(folder: str | Path) -> tuple[Qualification, tuple[str, ...]]:
    """The certificate of a folder made again from its recordings.

    Returns
    -------
    (qualification, differences) : what the recordings say now, and every figure or file that differs from the
        certificate that lies there; empty where it is reproduced.

    Raises
    ------
    ShakeError
        No certificate, or a recording that is absent.
    """
    top = Path(folder)
    path = top / "certificate.json"
    try:
        certified = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise ShakeError(f"{path}: is not a certificate of ./shake qualify") from None
    if certified.get("schema") != SCHEMA:
        raise ShakeError(f"{path}: schema {certified.get('schema')!r} is not {SCHEMA}")
    try:
        again = _again(certified, top / "recordings", str(path))
        differences = _differences(certified, again, checksums(top / "recordings"))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise ShakeError(f"{path}: damaged, {type(error).__name__} at {error}") from None
    return again, differences


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of each file below a folder, by its path from there."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _again(certified: dict[str, Any], recordings: Path, where: str) -> Qualification:
    """A certificate's test from its recordings; all but what was asked and the reason is computed again."""
    asked = dict(certified["required"])
    f, levels = np.array(asked.pop("frequencies")), np.array(asked.pop("levels"))
    required = RequiredSpectrum(frequencies=f, levels=levels, **asked)
    rules, per_octave = Rules.from_mapping(certified["rules"], where), int(certified["per_octave"])
    runs, step = [], 0.0
    for k in range(len(certified["runs"])):
        found = read_table_recording(recordings / f"run_{k + 1}")
        if found.acceleration is None:
            raise ShakeError(f"{recordings / found.name}: no topic imu")
        step = round(found.sample_time, 9)
        drive = np.zeros((0, 3)) if found.reference is None else found.reference
        runs.append(tested(drive, found.acceleration, step, required, rules, per_octave))
    searched = dict(certified["search"] or {})
    shift = float(searched.pop("shift", 0.1))
    band = SearchBand(**searched) if searched else None
    before, after = (
        None
        if band is None or certified["resonance"][when] is None
        else searched_in(recordings / f"search_{when}", band)
        for when in ("before", "after")
    )
    return Qualification(
        required=required,
        rules=rules,
        runs=tuple(runs),
        reason=certified["reason"],
        sample_time=step,
        about=certified["about"],
        recordings=(),
        before=before,
        after=after,
        shift=shift,
        per_octave=per_octave,
        search=band,
    )


def moved(shifts: tuple[Shift, ...], limit: float) -> str:
    """The resonances whose frequency moved by `limit` or more, in words; empty where none did."""
    return "; ".join(f"the specimen changed: {shift}" for shift in shifts if abs(shift.frequency) >= limit)


def search_of(content: dict[str, Any] | None) -> ResonanceSearch | None:
    """A search from a certificate."""
    if content is None:
        return None
    return ResonanceSearch(**{**content, "resonances": tuple(Resonance(**found) for found in content["resonances"])})


def searched_in(recording: Path | TableRecording, band: SearchBand) -> ResonanceSearch | None:
    """The resonances that a recording shows; None without pressures or acceleration."""
    run = read_table_recording(recording) if isinstance(recording, Path) else recording
    if run.pressure_a is None or run.pressure_b is None or run.acceleration is None:
        return None
    return band.of(run.pressure_a, run.pressure_b, run.acceleration, round(run.sample_time, 9))


def _differences(certified: dict[str, Any], again: Qualification, sums: dict[str, str]) -> tuple[str, ...]:
    """Files and figures that differ."""
    lines = [
        f"recordings/{n}: is not the file that was certified" for n in sums if sums[n] != certified["sha256"].get(n)
    ]
    lines += [f"recordings/{n}: is absent" for n in certified["sha256"] if n not in sums]
    for k, (before, run) in enumerate(zip(certified["runs"], again.runs, strict=True)):
        now = run.assessment.content()
        for old, new in zip(before["rules"], now["rules"], strict=True):
            if old != new:
                lines.append(f"run {k + 1}: {new['rule']}: {new['measured']}, the certificate says {old['measured']}")
        for name in ("frequencies", "required", "found"):
            if not _same(before[name], now[name]):
                lines.append(f"run {k + 1}: the spectra ({name}) are not those of the certificate")
        if not _same(before["error"], run.error):
            lines.append(f"run {k + 1}: misses {run.error:.6g}, the certificate says {before['error']:.6g}")
    for when, found in (("before", again.before), ("after", again.after)):
        said = search_of(certified["resonance"][when])
        if str(said) != str(found):
            lines.append(f"resonance {when} the test: {found}, the certificate says {said}")
    if bool(certified["passed"]) != again.passed:
        words = {True: "passed", False: "not passed"}
        lines.append(f"{words[again.passed]}, the certificate says {words[bool(certified['passed'])]}")
    return tuple(lines)


def _same(certified: Any, found: Any) -> bool:
    """Whether two figures agree as far as another machine's rounding lets them."""
    a, b = np.asarray(certified, dtype=np.float64), np.asarray(found, dtype=np.float64)
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=1e-6, atol=0.0))
