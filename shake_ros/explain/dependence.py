"""What remains: is the residual of the final model above the noise, and on what does it depend?

The acceleration residual of free-running simulations is compared with the noise of the accelerometer and grouped by
what might rule it (position, velocity, direction, load pressure, valve opening, flow, time); the share of its variance
that each grouping explains beyond chance tells what it depends on. A residual in a narrow band depends on frequency.
Single samples (an axis that reverses within one) are told apart from what is there all the time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.problem import SearchProblem
from shake_ros.search.selection import Selection
from shake_ros.search.unlisted_functions import UNLISTED
from shake_ros.signals.velocity_filter import filtered_velocity

PLACES = {
    "position": "force",
    "velocity": "friction",
    "direction": "friction",
    "load_pressure": "compressibility",
    "valve_opening": "valve",
    "flow": "flow",
    "frequency": "structure",
}


SINGLE = 1e-3  # part of all samples that still counts as single ones


@dataclass(frozen=True)
class Remaining:
    """What remains. ratio : residual to noise [-]; shares : explained share of the residual by quantity."""

    above_noise: bool
    ratio: float
    place: str | None
    depends_on: tuple[str, ...]
    shares: dict[str, float]
    text: str


UNKNOWN = Remaining(True, math.nan, None, (), {}, "not known: the residual could not be analysed")


def explained_share(values: np.ndarray, by: np.ndarray, groups: int) -> float:
    """Share of the variance of `values` that its mean in quantile groups of `by` explains, less what chance gives.

    A quantity of fewer values than groups, such as a direction, has a group for each.

    >>> x = np.linspace(-1.0, 1.0, 1000)
    >>> round(float(explained_share(x**2, x, 24)), 1)
    1.0
    """
    different = np.unique(by)
    if len(different) <= groups:
        group = np.searchsorted(different, by)
    else:
        edges = np.unique(np.quantile(by, np.linspace(0.0, 1.0, groups + 1)))
        group = np.clip(np.searchsorted(edges, by, side="right") - 1, 0, max(len(edges) - 2, 0))
    count = np.bincount(group)
    mean = np.bincount(group, values) / np.maximum(count, 1)
    centre = float(np.mean(values))
    between = float(np.sum(count * (mean - centre) ** 2))
    chance = (np.count_nonzero(count) - 1) * float(np.var(values))
    return max((between - chance) / max(float(np.var(values)) * len(values), 1e-300), 0.0)


def band_share(values: np.ndarray, sample_time: float) -> tuple[float, float]:
    """Largest share of the power within a third of an octave, and its frequency [Hz]."""
    frequency, power = welch(values, 1.0 / sample_time, nperseg=min(4096, len(values)))
    best = (0.0, 0.0)
    for centre in frequency[frequency > 0.5]:
        inside = (frequency > centre * 2 ** (-1 / 6)) & (frequency < centre * 2 ** (1 / 6))
        share = float(power[inside].sum() / power.sum())
        if share > best[0]:
            best = (share, float(centre))
    return best


def residual_series(
    problem: RecordingProblem, table: TableParameters
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Residual of a table, what it may depend on, and each sample's ratio to the noise, over all recordings."""
    residuals, noise = list[np.ndarray](), 0.0
    columns: dict[str, list[np.ndarray]] = {}
    for record in problem.records:
        out = problem.model.run(table, record)
        span = slice(record.start, None)
        if record.acceleration is not None:
            rest, deviation = record.acceleration_left(out[:, 2]), record.acceleration_noise()
        else:
            seen = filtered_velocity(out[:, 1], record.sample_time)
            rest, deviation = (record.velocity - seen)[span], record.velocity_noise()
        residuals.append(record.in_band(rest))
        noise += len(rest) * deviation**2
        for name, values in problem.model.quantities(record, out).items():
            columns.setdefault(name, []).append(values[span])
    rest = np.concatenate(residuals)
    ratios = rest / max(math.sqrt(noise / len(rest)), 1e-150)
    return rest, {n: np.concatenate(c) for n, c in columns.items()}, ratios


def without_single(ratios: np.ndarray) -> tuple[float, int]:
    """Root mean square of ratios without their largest, and how many these are: at most the part SINGLE of them.

    >>> without_single(np.array([1.0] * 999 + [80.0]))
    (1.0, 1)
    """
    few = math.ceil(SINGLE * len(ratios))
    return float(np.sqrt(np.mean(np.sort(ratios**2)[:-few]))), few


def remaining(problem: SearchProblem, found: Selection) -> Remaining:
    """Judge the residual of the final model on the validation data."""
    settings, final, noise = problem.settings, found.final.fit, problem.validation.noise_name
    rest, columns, ratios = residual_series(problem.validation, final.table)
    ratio = float(np.sqrt(np.mean(ratios**2)))
    shares = {name: explained_share(rest, values, settings.remaining_groups) for name, values in columns.items()}
    if ratio <= settings.remaining_above:
        text = f"nothing above the noise: the residual is {ratio:.2f} × {noise}"
        return Remaining(False, ratio, None, (), shares, text)
    most, few = without_single(ratios)
    if most <= settings.remaining_above:
        text = (
            f"nothing above the noise but single samples: the residual is {ratio:.2f} × {noise}, "
            f"{most:.2f} × without the largest {few} of {len(ratios)}"
        )
        return Remaining(False, ratio, None, (), shares, text)
    unpredictable = problem.validation.unpredictable
    at_most = settings.remaining_above**2 * problem.validation.noise_cost()
    if unpredictable > 1.0 and found.final.validation_cost <= at_most:
        text = (
            f"nothing above the process noise: the residual is {ratio:.2f} × {noise}, and responses to "
            f"the same command differ by {math.sqrt(unpredictable):.2f} × the noise"
        )
        return Remaining(False, ratio, None, (), shares, text)
    in_band, centre = band_share(rest, problem.validation.records[0].sample_time)
    shares["frequency"] = in_band if in_band > settings.most_of else 0.0
    if unpredictable <= 1.0 and ratio > settings.remaining_far_above and nothing_fits(found, settings.least_function):
        best = max(found.functions.gains.values()) if found.functions else 0.0
        text = (
            f"the residual is {ratio:.2f} × {noise}; no function of position, velocity, valve opening, load "
            f"pressure or time removes more than {100.0 * best:.0f} % of it; an effect with dynamics of its own, "
            "such as a nonlinear resonance, is likely"
        )
        return Remaining(True, ratio, "structure", ("frequency",), shares, text)
    least = settings.remaining_share
    order = sorted((name for name, share in shares.items() if share > least), key=lambda name: -shares[name])
    place = next((PLACES[name] for name in order if name in PLACES), None)
    where = f", mostly near {centre:.1f} Hz" if shares["frequency"] else ""
    depends = f"; it depends on {', '.join(order)}" if order else "; it depends on no single quantity"
    text = f"the residual is {ratio:.2f} × {noise}{where}{depends}"
    return Remaining(True, ratio, place, tuple(order), shares, text)


def nothing_fits(found: Selection, memoryless: float) -> bool:
    """Whether functions of one quantity were tried in the last step, none promised anything, and none of two helped."""
    if any(step.chosen.candidate.effect == UNLISTED for step in found.steps):
        return False
    return found.functions is not None and max(found.functions.gains.values(), default=1.0) < memoryless
