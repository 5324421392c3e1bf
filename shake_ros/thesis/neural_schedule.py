"""Thesis 6.3.5: θ_1 … θ_7 scheduled by a neural network from amplitude and frequency of the command, as `schedule`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shake_ros.api.loops import strict
from shake_ros.api.progress import Progress
from shake_ros.report.result_table import percent
from shake_ros.settings import find, read_yaml
from shake_ros.thesis.reproduce import Claim, ExperimentReport, Rows
from shake_ros.thesis.schedule import (
    ScheduleComparison,
    better_than_one_set,
    learning_chart,
    running_chart,
    schedule,
    verdict,
)

KEYS = ("settings", "good_within")
ONE, NETWORK = "one set", "schedule"


def run(progress: Progress, settings: str = "neural_schedule") -> ExperimentReport:
    """Five networks on the simulated table, beside one set of parameters and the physical effect."""
    path = find("reproduce", settings)
    asked = strict(read_yaml(path), KEYS, str(path))
    found = schedule(settings=asked["settings"], progress=progress)
    charts = [learning_chart(found.training)]
    for k, one in enumerate(found.compared):
        charts.append(running_chart(one.record, one.runs, found.change if k == 0 else None))
    return ExperimentReport(
        title="The neural schedule",
        lead="Thesis 6.3.5: a network gives the parameters for amplitude and frequency of the last two seconds.",
        claims=_claims(found, asked["good_within"]),
        tables=_tables(found),
        charts=charts,
        remarks=(
            "The text's network: two hidden layers of 100 sigmoid neurons, Levenberg–Marquardt; 80 % of the windows "
            "for training, 10 % for stopping, 10 % for testing. The text gives neither the number of windows nor "
            "their amplitudes and frequencies; those used here are in config/schedule.",
            verdict(found.seeds),
            "./shake schedule runs the same alone, also on recordings.",
        ),
    )


def _acceleration(errors: Mapping[str, Mapping[str, float]], model: str) -> float:
    return errors[model]["acceleration"]


def _claims(found: ScheduleComparison, good: float) -> list[Claim]:
    content: dict[str, Any] = found.content
    by_recording, later = content["error"], content["after_change"]["later"]
    effect = next(name for name in later if name not in (ONE, NETWORK))

    def each(model: str) -> str:
        return ", ".join(percent(_acceleration(errors, model)) for errors in by_recording.values())

    wins = better_than_one_set(found.seeds)
    tests = ", ".join(f"{s.training.test:.2f}" for s in found.seeds)
    tracked = all(_acceleration(errors, NETWORK) <= good for errors in by_recording.values())
    converges = _acceleration(later, NETWORK) <= max(good, _acceleration(later, ONE))
    least = all(
        min(errors, key=lambda model: _acceleration(errors, model)) == effect for errors in by_recording.values()
    )
    printed = "text only"
    return [
        Claim(
            "6.3.5, 6.27", "the simulated acceleration tracks the experiment with a good performance", "figure only",
            f"{each(NETWORK)}; one set {each(ONE)}", tracked,
        ),
        Claim(
            "6.3.5", "it converges while the input changes abruptly", printed,
            f"past the window {percent(_acceleration(later, NETWORK))}; one set {percent(_acceleration(later, ONE))}",
            converges,
        ),
        Claim(
            "6.3.5", "the network predicts for data that it has never seen", printed,
            f"test error {tests}, where the mean gives 1; better than one set in {wins} of {len(found.seeds)}",
            wins == len(found.seeds),
        ),
        Claim(
            "6.3.5", "for any input the effective bulk modulus has to be modelled", printed,
            f"with {effect} {each(effect)}", least,
        ),
    ]  # fmt: skip


def _tables(found: ScheduleComparison) -> list[Rows]:
    windows, errors = found.windows, found.error
    return [
        Rows(
            "Test windows of the networks, free run",
            ("seed", "parameters", "velocity", "acceleration"),
            [[str(seed), name, percent(v), percent(a)] for seed, name, v, a in map(dict.values, windows.rows)],
        ),
        Rows(
            "Validation data, free run",
            ("recording", "model", "velocity", "acceleration"),
            [[title, name, percent(v), percent(a)] for title, name, v, a in map(dict.values, errors.rows)],
        ),
    ]
