"""What remains: is the residual of the final model above the noise, and on what does it depend?

The acceleration residual of free-running simulations is compared with the noise of the accelerometer and grouped by
what might rule it (position, velocity, direction, load pressure, valve opening, flow, time); the share of its variance
that each grouping explains beyond chance tells what it depends on. A residual in a narrow band depends on frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from shake_ros.core.discovery.refits import mean_square
from shake_ros.core.discovery.search import Search
from shake_ros.core.identification.recordings import RecordingProblem, low_pass

ABOVE = 1.15  # ratio of residual to noise from which something remains
FAR_ABOVE = 3.0  # ratio of residual to noise from which what fits no function counts as a motion of its own
GROUPS = 24  # quantile groups of a quantity
SHARE = 0.05  # explained share of the residual's variance from which it depends on a quantity
MEMORYLESS = (
    0.1  # gain that every function without a name stays below where something with states of its own is missing
)
BAND_SHARE = 0.6  # share of the power within a third of an octave from which it depends on frequency
PLACES = {
    "position": "force",
    "velocity": "friction",
    "direction": "friction",
    "load_pressure": "compressibility",
    "valve_opening": "valve",
    "flow": "flow",
    "frequency": "structure",
}


@dataclass(frozen=True)
class Remaining:
    """What remains. ratio : residual to noise [-]; shares : explained share of the residual by quantity."""

    above_noise: bool
    ratio: float
    place: str | None
    depends_on: tuple[str, ...]
    shares: dict[str, float]
    text: str


def explained_share(values: np.ndarray, by: np.ndarray) -> float:
    """Share of the variance of `values` that its mean in quantile groups of `by` explains, less what chance gives.

    >>> x = np.linspace(-1.0, 1.0, 1000)
    >>> round(float(explained_share(x**2, x)), 1)
    1.0
    """
    edges = np.unique(np.quantile(by, np.linspace(0.0, 1.0, GROUPS + 1)))
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


def residual_series(problem: RecordingProblem, search: Search) -> tuple[np.ndarray, dict[str, np.ndarray], float]:
    """Residual of the final model, what it may depend on, and its ratio to the noise, over all recordings."""
    table = search.final.free.table(search.final.x)
    residuals: list[np.ndarray] = []
    columns: dict[str, list[np.ndarray]] = {}
    square = noise = 0.0
    for record in problem.records:
        out = problem.model.run(table, record)
        span = slice(record.start, None)
        if record.acceleration is not None:
            rest, deviation = (record.acceleration - out[:, 2])[span], record.acceleration_noise()
        else:
            rest, deviation = (record.velocity - low_pass(out[:, 1], record.sample_time))[span], record.velocity_noise()
        residuals.append(rest)
        square += float(rest @ rest)
        noise += len(rest) * deviation**2
        for name, values in problem.model.quantities(record, out).items():
            columns.setdefault(name, []).append(values[span])
    ratio = float(np.sqrt(square / max(noise, 1e-300)))
    return np.concatenate(residuals), {n: np.concatenate(c) for n, c in columns.items()}, ratio


def remaining(problem: RecordingProblem, search: Search) -> Remaining:
    """Judge the residual of the final model on the given recordings."""
    rest, columns, ratio = residual_series(problem, search)
    shares = {name: explained_share(rest, values) for name, values in columns.items()}
    if ratio <= ABOVE:
        text = f"nothing above the noise: the residual is {ratio:.2f} times the sensor noise"
        return Remaining(False, ratio, None, (), shares, text)
    in_band, centre = band_share(rest, problem.records[0].sample_time)
    shares["frequency"] = in_band if in_band > BAND_SHARE else 0.0
    if ratio > FAR_ABOVE and nothing_fits(search):
        best = max(search.unnamed.gains.values()) if search.unnamed else 0.0
        text = (
            f"the residual is {ratio:.2f} times the sensor noise; no function of position, velocity, opening, load "
            f"pressure or time would take more than {100.0 * best:.0f} % off it: something with a motion of its own, "
            "such as a resonance that is not linear"
        )
        return Remaining(True, ratio, "structure", ("frequency",), shares, text)
    order = sorted((name for name, share in shares.items() if share > SHARE), key=lambda name: -shares[name])
    place = next((PLACES[name] for name in order if name in PLACES), _nearest_place(search))
    where = f", mostly about {centre:.1f} Hz" if shares["frequency"] else ""
    depends = f"; it goes with {', '.join(order)}" if order else "; it follows no single quantity"
    text = f"the residual is {ratio:.2f} times the sensor noise{where}{depends}"
    return Remaining(True, ratio, place, tuple(order), shares, text)


def nothing_fits(search: Search) -> bool:
    """Whether functions without a name were tried in the last round and none promised anything."""
    return search.unnamed is not None and max(search.unnamed.gains.values(), default=1.0) < MEMORYLESS


def _nearest_place(search: Search) -> str | None:
    """Place of the candidate that explains some of the rest, though not enough to be added."""
    if not search.rejected:
        return None
    learned = mean_square(search.final.residuals)
    near = [a for a in search.rejected if a.learn < (1.0 - SHARE) * learned]
    return near[0].candidate.place if near else None
