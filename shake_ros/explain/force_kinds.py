"""What kind of thing a missing force is: a table of kinds, each a share of the force's power with a threshold.

    constant      its mean; the other kinds are shares of the whole power too, so that they are not read into what
                  little varies beside it
    slow          below a frequency: a drift
    line          about one frequency at which the table does not move as much
    at reversals  within a short time of the velocity's zeros, more than those times would have by chance
    impulsive     few short events: kurtosis
    memory        the position behind backlash, or within it, explains more of it than position, direction or velocity:
                  a loop that is no friction

and on which quantities it depends (`explained_share`), less what chance would explain of a force that is as smooth. A
force that stays within its confidence band is zero and of no kind, unless the run is far above its noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.explain.dependence import band_share, explained_share
from shake_ros.physics.valve.simplified import backlash
from shake_ros.search.search_settings import SearchSettings

Array = NDArray[np.float64]
SAMPLES = 4  # independent ones that each group needs
SIMPLER = 0.03  # share by which direction, of which velocity tells as well, may lie behind it
WIDTHS = (0.1, 0.3, 0.6, 1.0)  # half widths, in standard deviations of the position
THIRD = 2.0 ** (1.0 / 6.0)  # from the centre of a third of an octave to its ends
SAYS = {  # kind → what it says of the force
    "constant": "is constant",
    "slow": "drifts slowly",
    "line": "is a line at {line:.1f} Hz",
    "at reversals": "acts at reversals",
    "impulsive": "consists of a few short events",
    "memory": "depends on the previous motion",
}


@dataclass(frozen=True)
class ForceKinds:
    """Kinds of a force.

    Attributes
    ----------
    zero : whether it stays within its band. outside : share of the time outside. highest : largest ratio to its
    standard deviation. kinds : those whose measure is beyond the threshold. depends_on : explained shares [-] by
    quantity, the largest first. measures : of every kind. line : frequency of the largest share of a third of an octave
    [Hz]. A force that is zero has none of these.
    """

    zero: bool
    outside: float
    highest: float
    kinds: tuple[str, ...]
    depends_on: dict[str, float]
    measures: dict[str, float]
    line: float

    @property
    def text(self) -> str:
        """One phrase of what the force is."""
        if self.zero:
            return "is zero within its band"
        said = [SAYS[kind].format(line=self.line) for kind in self.kinds]
        names = [name.replace("_", " ") for name in self.depends_on]
        if names:
            said.append(f"follows {' and '.join(names[:2])}")
        if said:
            return ", ".join(said)
        return "has no simple cause: it depends on no single quantity and has no frequency of its own"


def band_factor(probability: float) -> float:
    """Half the width of a confidence band, in standard deviations.

    >>> round(band_factor(0.9), 3)
    1.645
    """
    return NormalDist().inv_cdf(0.5 + 0.5 * probability)


def degrees_of_freedom(force: Array) -> float:
    """Number of independent samples that have as even a spectrum as a force.

    >>> round(degrees_of_freedom(np.sin(np.arange(1000.0))))
    2
    """
    power = np.abs(np.fft.rfft(force - np.mean(force))) ** 2
    return max(2.0 * float(np.sum(power)) ** 2 / max(float(np.sum(power**2)), 1e-300), 2.0)


def adjusted_share(force: Array, by: Array, groups: int, independent: float) -> float:
    """Explained share of a force, less what as many groups explain by chance of so many independent samples [-].

    >>> x = np.sin(0.01 * np.arange(5000.0))
    >>> round(adjusted_share(x**2, x, 12, 60.0), 1)
    1.0
    """
    chance = (min(groups, len(np.unique(by))) - 1) / independent
    return float(max(explained_share(force, by, groups) - chance, 0.0) / (1.0 - chance))


def groups_of(force: Array, settings: SearchSettings) -> tuple[int, float]:
    """Groups that a force of so many independent samples can fill, and the number of these."""
    independent = degrees_of_freedom(force)
    return min(settings.remaining_groups, max(int(independent / SAMPLES), 2)), max(independent, 2.0 * SAMPLES)


def dependence(force: Array, known: dict[str, Array], settings: SearchSettings) -> dict[str, float]:
    """Share of a force's variance that each quantity explains beyond the chance of a force as smooth [-]."""
    groups, independent = groups_of(force, settings)
    return {name: float(adjusted_share(force, by, groups, independent)) for name, by in known.items()}


def near_reversal(velocity: Array, sample_time: float, within: float) -> NDArray[np.bool_]:
    """Samples within a time [s] of a change of the velocity's sign."""
    turns = np.flatnonzero(np.diff(np.signbit(velocity)))
    near = np.zeros(len(velocity) + 1)
    reach = max(round(within / sample_time), 1)
    np.add.at(near, np.maximum(turns + 1 - reach, 0), 1.0)
    np.add.at(near, np.minimum(turns + 1 + reach, len(velocity)), -1.0)
    return np.cumsum(near)[:-1] > 0.0


@njit
def behind_backlash(values, width):  # type: ignore[no-untyped-def]
    """Values behind backlash of half a width."""
    result, held = np.empty_like(values), values[0]
    for k in range(len(values)):
        held = backlash(held, values[k], width)
        result[k] = held
    return result


def memory(force: Array, known: dict[str, Array], settings: SearchSettings) -> float:
    """Share that the position behind backlash, or within it, explains beyond position, direction or velocity [-]."""
    groups, independent = groups_of(force, settings)
    position = np.ascontiguousarray(known["position"], dtype=np.float64)
    behind = [behind_backlash(position, width * float(np.std(position))) for width in WIDTHS]
    loops = [by for follows in behind for by in (follows, position - follows)]
    best = max(adjusted_share(force, by, groups, independent) for by in loops)
    alone = (adjusted_share(force, known[n], groups, independent) for n in ("position", "direction", "velocity"))
    return max(float(best - max(alone)), 0.0)


def in_band(values: Array, sample_time: float, low: float, high: float) -> float:
    """Share of the power between two frequencies [Hz]."""
    power = np.abs(np.fft.rfft(values - np.mean(values))) ** 2
    frequency = np.fft.rfftfreq(len(values), sample_time)
    return float(power[(frequency >= low) & (frequency < high)].sum() / max(float(power.sum()), 1e-300))


def measured(
    force: Array, known: dict[str, Array], sample_time: float, settings: SearchSettings
) -> tuple[dict[str, float], float]:
    """The measure of every kind [-], and the frequency of the line [Hz]."""
    moving = force - np.mean(force)
    total = max(float(np.mean(force**2)), 1e-300)
    share, line = band_share(moving, sample_time)
    motion = in_band(known["velocity"], sample_time, line / THIRD, line * THIRD)
    near = near_reversal(known["velocity"], sample_time, settings.force_reversal)
    by_chance = float(np.mean(near))
    square = max(float(np.mean(moving**2)), 1e-300)
    energy = float(np.sum(moving[near] ** 2)) / (square * len(moving))
    varying = square / total
    return {
        "constant": 1.0 - varying,
        "slow": varying * in_band(force, sample_time, 0.0, settings.slowest),
        "line": varying * (share if motion < 0.5 * share else 0.0),
        "at reversals": varying * (energy if energy > 2.0 * by_chance else 0.0),
        "impulsive": float(np.mean(moving**4)) / square**2 if varying > 0.5 else 0.0,
        "memory": varying * memory(moving, known, settings),
    }, line


def beside_band(force: Array, deviation: Array, left: float, settings: SearchSettings) -> tuple[bool, float, float]:
    """Whether a force is zero, the share of the time outside its band, and the largest ratio to its deviation.

    left : what the run without it leaves, in multiples of the noise. Far above the noise something is missing, though
    it may change too fast to leave its band at any one instant.
    """
    ratio = np.abs(force) / np.maximum(deviation, 1e-300)
    outside, highest = float(np.mean(ratio > band_factor(settings.force_band))), float(np.max(ratio))
    within = outside <= 1.0 - settings.force_band and highest <= settings.force_highest
    return within and left <= settings.near_noise, outside, highest


def judged_kinds(
    force: Array,
    deviation: Array,
    left: float,
    known: dict[str, Array],
    sample_time: float,
    settings: SearchSettings,
) -> ForceKinds:
    """What kind of thing a force is.

    Parameters
    ----------
    force, deviation : shape (n,). left : as of `beside_band`. known : what it may depend on, each of shape (n,).
    """
    zero, outside, highest = beside_band(force, deviation, left, settings)
    if zero:
        return ForceKinds(True, outside, highest, (), {}, {}, 0.0)
    measures, line = measured(force, known, sample_time, settings)
    least = {
        "constant": settings.most_of,
        "slow": settings.most_of,
        "line": settings.most_of,
        "at reversals": settings.most_of,
        "impulsive": settings.force_kurtosis,
        "memory": settings.force_memory,
    }
    kinds = tuple(kind for kind, threshold in least.items() if measures[kind] > threshold)
    varying = 1.0 - measures["constant"]
    shares = {name: varying * share for name, share in dependence(force, known, settings).items()}
    simplest = {n: share + (SIMPLER if n == "direction" else 0.0) for n, share in shares.items()}
    named = sorted((n for n, share in shares.items() if share > settings.most_of**2), key=lambda n: -simplest[n])
    return ForceKinds(False, outside, highest, kinds, {n: shares[n] for n in named}, measures, line)
