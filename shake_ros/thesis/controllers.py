"""Thesis 6.4.2 to 6.4.5: feedforward PI, sliding mode and super-twisting, in the thesis's loop and in two others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from statistics import fmean
from typing import Any

import numpy as np

from shake_ros.api.compare import Comparison, amplitudes, compare, error_chart, number, response_chart, spectrum_chart
from shake_ros.api.progress import Progress
from shake_ros.control.metrics import Metrics, Outcome, over
from shake_ros.report.chart import Chart
from shake_ros.thesis.reproduce import Claim, ExperimentReport, Rows, asked_in

LAWS = ("feedforward PI", "sliding mode", "super-twisting")
LOOPS = ("thesis's loop", "linear observer", "tuned gains")
OTHER = "thesis's loop, table 6.8"  # on the other plant
KEYS = ("settings", "other_plant", "sines", "tracks_within", "same_within", "responses")
FIGURES = {"position_error": "position", "velocity_error": "velocity", "acceleration_error": "acceleration"}
HEAD = ("controller", *FIGURES.values(), "command travel [1/s]", "unstable runs")


def run(progress: Progress, settings: str = "controllers") -> ExperimentReport:
    """All loops of config/compare/thesis.yaml, judged as config/reproduce/controllers.yaml, or another file, says."""
    words = asked_in(settings, KEYS)
    found = compare(words["settings"], progress=progress)
    printed = [f"{law}, {LOOPS[0]}" for law in LAWS]
    other = compare(words["settings"], only=printed, changes=words["other_plant"], progress=progress)
    drawn = _responses(words, printed, progress)
    for loop in LOOPS:
        runs = {law: found.runs[f"{law}, {loop}"] for law in LAWS}
        drawn.append(error_chart(runs, f"figure 6.61, {loop}, {found.drawn}"))
        drawn.append(spectrum_chart(runs, f"figure 6.62, {loop}, {found.drawn}"))
    return ExperimentReport(
        title="The three controllers compared",
        lead=f"Thesis 6.4.2 to 6.4.5. {found.plant}",
        claims=[claim for loop in LOOPS for claim in _claims(found, loop, words)]
        + [c._replace(statement=c.statement.replace(LOOPS[0], OTHER)) for c in _claims(other, LOOPS[0], words)],
        tables=[
            Rows(f"{title}, {plant}", HEAD, rows)
            for plant, of, loops in (
                ("plant of table 6.9", found, LOOPS),
                ("plant of table 6.8 with soft zone", other, LOOPS[:1]),
            )
            for title, rows in (
                ("Mean over two sines and three earthquakes with 0, 200 and 500 kg", _rows(of, loops, None, None)),
                ("The earthquake of the figures with 200 kg", _rows(of, loops, *_case(of))),
            )
        ],
        charts=drawn,
        remarks=(
            "The thesis's loop has its printed gains and its sliding-mode observer (6.38) with the β of table 6.11, "
            "solved implicitly because forward Euler diverges at 1 kHz; the other loops put a linear observer in its "
            "place, with the printed gains and with tuned ones.",
            "The text gives neither amplitude nor frequency of its sines nor the earthquake record; two sines and "
            "three synthetic records stand for them. Noise, converter and one sample of delay are those of the plant.",
            f"Smoothness of the velocity error is judged by its rate, the acceleration error. A controller tracks up "
            f"to {100.0 * words['tracks_within']:g} % of position error; an error that grows by up to "
            f"{100.0 * words['same_within']:g} % from 0 to 500 kg counts as the same.",
            "Under feedforward PI the observer decides: its position estimate follows the measurement at λ_1 = 0.03 "
            "m/s only once its velocity is off by more than that, and PI uses nothing but that estimate.",
        ),
    )


def _responses(words: Mapping[str, Any], printed: Sequence[str], progress: Progress) -> list[Chart]:
    """Figures 6.43 to 6.60: position, velocity and command of each law in its cases, in the thesis's loop."""
    cases = {(w["reference"], float(w["load"])) for w in words["responses"].values()}
    runs = {}
    for reference, load in sorted(cases):
        alone = {"references": [reference], "loads": [load], "figure_reference": reference, "figure_load": load}
        runs[reference, load] = compare(words["settings"], only=printed, changes=alone, progress=progress).runs
    return [
        response_chart(
            number, runs[w["reference"], float(w["load"])][f"{w['law']}, {LOOPS[0]}"],
            f"As figures {number}: {w['law']}, {w['reference']}, {w['load']:g} kg",
        )
        for number, w in words["responses"].items()
    ]  # fmt: skip


def _case(found: Comparison) -> tuple[str, float]:
    """Reference and load of the figures."""
    return str(found.settings["figure_reference"]), float(found.settings["figure_load"])


def _metrics(
    found: Comparison, entry: str, reference: str | Sequence[str] | None = None, load: float | None = None
) -> tuple[Metrics, int]:
    """Mean figures over the runs of an entry, or over those of some references or one load, and how many ring."""
    names = (reference,) if isinstance(reference, str) else reference

    def counts(o: Outcome) -> bool:
        return o.entry == entry and (names is None or o.reference in names) and (load is None or o.load == load)

    own = [o for o in found.outcomes if counts(o)]
    return over(own, fmean), sum(o.metrics.unstable for o in own)


def _rows(found: Comparison, loops: Sequence[str], reference: str | None, load: float | None) -> list[list[str]]:
    rows = []
    for loop in loops:
        for law in LAWS:
            m, unstable = _metrics(found, f"{law}, {loop}", reference, load)
            shares = [f"{100.0 * getattr(m, name):.1f} %" for name in FIGURES]
            rows.append([f"{law}, {loop}", *shares, number(m.command_travel), str(unstable)])
    return rows


def spectral_error(found: Comparison, entry: str, column: int) -> float:
    """Root mean square difference of the amplitudes up to 30 Hz, relative to the reference's; inf of a lost run."""
    run = found.runs[entry]
    if not np.isfinite(run.truth).all():
        return float("inf")
    wanted, got = (amplitudes(part[:, column], run.sample_time)[1] for part in (run.reference, run.truth))
    return float(np.linalg.norm(got - wanted) / np.linalg.norm(wanted))


def _claims(found: Comparison, loop: str, words: Mapping[str, Any]) -> list[Claim]:
    """The claims of 6.4 under one loop."""

    def least(source: str, text: str, values: Mapping[str, float], write: Callable[[float], str]) -> Claim:
        shown = ", ".join(f"{law} {write(value)}" for law, value in values.items())
        holds = min(values, key=lambda law: values[law]) == "super-twisting"
        return Claim(source, f"{text} ({loop})", "figure only", shown, holds)

    def share(value: float) -> str:
        return f"{100.0 * value:.1f} %"

    case = {law: _metrics(found, f"{law}, {loop}", *_case(found))[0] for law in LAWS}
    everywhere = {law: _metrics(found, f"{law}, {loop}") for law in LAWS}
    claims = [
        least("6.4.5, 6.61", "position error least under super-twisting, earthquake at 200 kg",
              {law: m.position_error for law, m in case.items()}, share),
        least("6.4.5, 6.61", "velocity error least under super-twisting, earthquake at 200 kg",
              {law: m.velocity_error for law, m in case.items()}, share),
        least("6.4.5, 6.61", "velocity error smoothest under super-twisting",
              {law: m.acceleration_error for law, m in case.items()}, share),
        least("6.4.5, 6.62", "spectra of position best under super-twisting",
              {law: spectral_error(found, f"{law}, {loop}", 0) for law in LAWS}, share),
        least("6.4.5, 6.62", "spectra of velocity best under super-twisting",
              {law: spectral_error(found, f"{law}, {loop}", 1) for law in LAWS}, share),
        least("6.4.5", "position error least under super-twisting, mean of all runs",
              {law: m.position_error for law, (m, _) in everywhere.items()}, share),
        least("6.4.4", "command smoother under super-twisting than under sliding mode [1/s]",
              {law: everywhere[law][0].command_travel for law in LAWS[1:]}, number),
    ]  # fmt: skip
    for law, source in (("sliding mode", "6.4.3, 6.50"), ("super-twisting", "6.4.4, 6.57")):
        light, heavy = (_metrics(found, f"{law}, {loop}", words["sines"], load)[0] for load in (0.0, 500.0))
        both = {f: (getattr(light, f), getattr(heavy, f)) for f in ("position_error", "velocity_error")}
        holds = all(loaded <= (1.0 + words["same_within"]) * alone for alone, loaded in both.values())
        shown = "; ".join(f"{FIGURES[f]} {share(alone)} → {share(loaded)}" for f, (alone, loaded) in both.items())
        claims.append(Claim(source, f"sines under {law} the same with 500 kg ({loop})", "figure only", shown, holds))
    for law, source in zip(LAWS, ("6.4.2", "6.4.3", "6.4.4"), strict=True):
        m, unstable = everywhere[law]
        holds = unstable == 0 and m.position_error <= words["tracks_within"]
        count = sum(o.entry == f"{law}, {loop}" for o in found.outcomes)
        shown = f"position {share(m.position_error)}, {unstable} of {count} runs unstable"
        claims.append(Claim(source, f"{law} tracks the references ({loop})", "figure only", shown, holds))
    return claims
