"""Printed and fitted models of the measured runs, one beside the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.measured_harmonics.account import HarmonicAccount, account
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem
from shake_ros.core.measured_harmonics.left_out_runs import NEIGHBOURS, LeftOut, left_out
from shake_ros.core.measured_harmonics.variants import FittedVariant, MeasuredRuns, Progress, Variant, second_effect
from shake_ros.core.plant.parameters import TableParameters


@dataclass(frozen=True)
class MeasuredModel:
    """One model of the runs: as printed, or fitted to them.

    Attributes
    ----------
    name : for people. table : its parameters. account : what it makes of the runs.
    fitted : None where the parameters are printed. left_out : predictions of the runs left out, where they were made.
    """

    name: str
    table: TableParameters
    account: HarmonicAccount
    fitted: FittedVariant | None = None
    left_out: LeftOut | None = None


@dataclass(frozen=True)
class HarmonicComparison:
    """Models printed, then fitted: the declared one, single extensions and second ones on top of the best of these.

    `best` is the place among `fitted` of the model that explains the runs best by the information criterion without a
    second effect; `exchanged` are the last printed model with one group of its parameters from that fit; `seconds` are
    ordered by the criterion.
    """

    problem: HarmonicProblem
    printed: tuple[MeasuredModel, ...]
    fitted: tuple[MeasuredModel, ...]
    best: int
    exchanged: tuple[MeasuredModel, ...]
    seconds: tuple[MeasuredModel, ...]

    @property
    def chosen(self) -> MeasuredModel:
        """The best fitted model."""
        return self.fitted[self.best]

    @property
    def models(self) -> tuple[MeasuredModel, ...]:
        """All of them."""
        return (*self.printed, *self.fitted, *self.seconds)


def printed_model(problem: HarmonicProblem, name: str, table: TableParameters) -> MeasuredModel:
    """A table whose parameters are given."""
    return MeasuredModel(name, table, account(problem, table.vector()))


def fitted_model(problem: HarmonicProblem, fitted: FittedVariant, neighbours: int = NEIGHBOURS) -> MeasuredModel:
    """A fitted model with each run left out once."""
    vector = fitted.fit.vector
    table = fitted.fit.table
    name = f"with {fitted.name}, fitted" if fitted.name else "declared model, fitted"
    prediction = left_out(problem, fitted.fit, neighbours) if len(problem.runs) > 1 else None
    return MeasuredModel(name, table, account(problem, vector), fitted, prediction)


def exchanged_models(problem: HarmonicProblem, printed: MeasuredModel, fitted: MeasuredModel) -> list[MeasuredModel]:
    """A printed table with the parameters of one section or effect at a time from a fit: which one matters?"""
    assert fitted.fitted is not None
    groups: dict[str, dict[str, float]] = {}
    for name in fitted.fitted.fit.free.names:
        group = name.removeprefix("effects.").partition(".")[0]
        groups.setdefault(group, {})[name] = fitted.table.value(name)
    return [
        printed_model(problem, f"its {group} from the fit", printed.table.with_values(values))
        for group, values in groups.items()
    ]


def compare(
    runs: MeasuredRuns,
    printed: Mapping[str, TableParameters],
    seconds: Sequence[Variant],
    progress: Progress,
    neighbours: int = NEIGHBOURS,
) -> HarmonicComparison:
    """Account for every model of a study, and for second effects on top of its best one.

    Parameters
    ----------
    printed : tables by name. seconds : extensions to try on top. neighbours : starts of the fits with a run left out.
    """
    problem, best = runs.problem, runs.best
    single = [runs.declared, *runs.variants]
    steps = len(single) + 2 * len(seconds)
    fitted, added = [], []
    for i, model in enumerate(single):
        progress(f"runs left out, {model.name or 'declared model'}", i / steps)
        fitted.append(fitted_model(problem, model, neighbours))
    for i, variant in enumerate(seconds):
        progress(f"second effect: {variant.name}", (len(single) + 2 * i) / steps)
        model = second_effect(runs, variant)
        progress(f"runs left out, {model.name}", (len(single) + 2 * i + 1) / steps)
        added.append(fitted_model(problem, model, neighbours))
    added.sort(key=lambda m: m.fitted.criterion if m.fitted else np.inf)
    given = tuple(printed_model(problem, name, table) for name, table in printed.items())
    index = single.index(best)
    exchanged = exchanged_models(problem, given[-1], fitted[index]) if given else []
    return HarmonicComparison(problem, given, tuple(fitted), index, tuple(exchanged), tuple(added))
