"""What differs from recording to recording and tells nothing of the table: offsets of the sensors, null of the valve.

The accelerometer's bias is its mean less the change of the velocity; where it wanders, a cubic in time goes through
what the acceleration has beyond the second derivative of the position. The null shift is what the regression of the
slow velocity on the command leaves as a constant; a term in |u| keeps a gain that differs by direction out of it. Both
are taken out of the recording before a fit, what is left of them within it (recording_problem.py); what all recordings
have in common of the null shift is free in the fit. The delay of the accelerometer's filter is that of the set-up
(sensor_pair.py) and is taken out as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, decimate, sosfiltfilt

from shake_ros.fit.nuisances.estimates import NuisanceEstimates
from shake_ros.fit.nuisances.explained_band import limited
from shake_ros.fit.nuisances.glitches import unseen_glitches, without
from shake_ros.fit.nuisances.sensor_pair import ALIKE, SensorPair, sensor_pair, timely
from shake_ros.fit.records import Record
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.quantities import ShakeError

FASTEST = 1000.0  # rate of a recording that a fit takes [Hz]
SLOW = 2.0  # the table follows its valve up to here, whatever its dynamics [Hz]
LONG, CUBIC = 5.0, 3  # seconds from which a bias is seen to wander, and as a polynomial of which degree
WANDERS = 0.5  # of the noise, from which the deviation of that polynomial counts
UNMADE = 0.8  # of a filter's delay, below which something makes up for it
ONE_SIDED = 0.1  # smallest command in parts of the largest, from which its zero is not that of the valve
LIVE_ZERO = (3.5, 20.5)  # within which a command in 4 to 20 mA stays [mA]
FARTHEST = 4.0  # travel of a shaking table, which no built one reaches [m]
FULL_SCALES = (1.0, 10.0, 20.0, 100.0)  # of a command: per unit, volts, milliamperes, per cent


@dataclass(frozen=True)
class Nuisance:
    """What was taken out of one recording.

    null_shift : of the valve [-]. acceleration_bias [m/s²], None without acceleration. glitches : of the command.
    drift : by which the bias wanders, from its least to its largest [m/s²].
    """

    recording: str
    null_shift: float
    acceleration_bias: float | None
    glitches: int = 0
    drift: float = 0.0


@dataclass(frozen=True)
class Prepared:
    """Recordings with their offsets taken out.

    full_scale : of the recorded command, which counts as 1 from here on. sensors : what position and acceleration tell
    of each other at first; the recordings' `delay` has been taken out but that of a filter with their `cutoff`.
    ahead : time by which commands that were recorded late have been moved (start/linear_table.py) [s]. stops : a line
    on what of the recordings no fit uses (start/data_checks.py).
    """

    estimation: list[Record]
    validation: list[Record]
    full_scale: float
    nuisances: tuple[Nuisance, ...]
    sensors: SensorPair = ALIKE
    ahead: float = 0.0
    stops: tuple[str, ...] = ()

    def alike(self, records: Sequence[Record]) -> tuple[list[Record], tuple[Nuisance, ...]]:
        """Other recordings with scale and sensors as these have shown, without their own offsets; and these."""
        first = 1 + max((r.run for r in (*self.estimation, *self.validation)), default=-1)
        places = unseen_glitches(records)
        scaled = [
            per_unit(thinned(without_glitches(r, at)), self.full_scale) for r, at in zip(records, places, strict=True)
        ]
        found, offsets = _without_offsets(scaled, self.sensors.delay, places, first)
        band = self.estimation[0].explained if self.estimation else None
        return (found if band is None else limited(found, band.highest, self.estimation)), offsets

    def below(self, band: float) -> Prepared:
        """The same, compared below a frequency [Hz] alone."""
        both, count = limited([*self.estimation, *self.validation], band, self.estimation), len(self.estimation)
        return replace(self, estimation=both[:count], validation=both[count:])

    def with_nuisances(self, nuisances: NuisanceEstimates) -> Prepared:
        """The same with nuisance parameters that a model has given."""
        both = [[nuisances.applied(r) for r in records] for records in (self.estimation, self.validation)]
        more = {
            after.name: after.shift - before.shift
            for before, after in zip((*self.estimation, *self.validation), (*both[0], *both[1]), strict=True)
        }
        offsets = tuple(replace(n, null_shift=n.null_shift + more.get(n.recording, 0.0)) for n in self.nuisances)
        return replace(self, estimation=both[0], validation=both[1], nuisances=offsets)

    @property
    def delay(self) -> float:
        """Of the accelerometer [s]."""
        return max((r.delay for r in self.estimation), key=abs, default=0.0)

    @property
    def cutoff(self) -> float:
        """Of the filter behind the accelerometer [Hz]; 0 where its delay is all that shows."""
        return max((r.cutoff for r in self.estimation), default=0.0)

    def changes(self) -> list[str]:
        """What was done to the signals, a phrase each."""
        notes = (self.lateness(), self.promptness(), self.glitches(), self.drifts(), self.note(), self.limit())
        return [*filter(None, notes)]

    def limit(self) -> str:
        """The frequency below which the recordings are compared; empty where all of them is."""
        band = self.estimation[0].explained if self.estimation else None
        if band is None:
            return ""
        return (
            f"compared below {band.highest:.3g} Hz: above, no filter of the command explains any of the acceleration; "
            "below, what a linear one leaves counts as noise"
        )

    @property
    def _position_early(self) -> bool:
        """Whether command and accelerometer are later than the position by the same time, up to a sample."""
        return self.delay > 0.0 and 0.0 <= self.ahead - self.delay < max(r.sample_time for r in self.estimation)

    def lateness(self) -> str:
        """How late the accelerometer is and what for; empty where it is not."""
        if not self.delay and not self.cutoff:
            return ""
        if self._position_early:
            early = f"position earlier than command and accelerometer by {1e3 * self.delay:.2f} ms"
            return f"{early}; both were moved to it"
        if self.cutoff and self.cutoff * self.delay < UNMADE * FILTER_DELAY:
            late = f"later than the position by {1e3 * self.delay:.2f} ms only"
            return (
                f"accelerometer behind a low-pass of {self.cutoff:.3g} Hz, {late}; its clock compensates for the rest"
            )
        cutoff = f", a low-pass of {self.cutoff:.3g} Hz" if self.cutoff else ""
        return f"accelerometer later than the position by {1e3 * self.delay:.2f} ms (its filter{cutoff})"

    def promptness(self) -> str:
        """By how much a late command was moved; empty where it was not."""
        if not self.ahead or self._position_early:
            return ""
        return (
            f"the table moves before its recorded command, which was moved {1e3 * self.ahead:.2f} ms earlier; the dead "
            "time is counted from there"
        )

    def glitches(self) -> str:
        """How many glitches were taken out of the commands; empty where none was."""
        count = sum(n.glitches for n in self.nuisances)
        return f"{count} glitches removed from the commands; the motion does not follow them" if count else ""

    def drifts(self) -> str:
        """By how much the biases of the accelerometer wander; empty where none does."""
        drifts = {n.recording: n.drift for n in self.nuisances if n.drift}  # a recording in pieces is named once
        sizes = ", ".join(f"{name} {drift:.3g}" for name, drift in drifts.items())
        return f"drift of the accelerometer's bias removed [m/s²]: {sizes}" if drifts else ""

    def note(self) -> str:
        """What was assumed of the command; empty where it is per unit."""
        if self.full_scale == 1.0:
            return ""
        return f"the command exceeds 1; a full scale of {self.full_scale:g} (V, mA or %) is assumed"


def full_scale(records: Sequence[Record]) -> float:
    """The smallest usual full scale that holds all commands."""
    largest = max(float(np.max(np.abs(r.commands))) for r in records)
    return next((s for s in FULL_SCALES if largest <= 1.05 * s), largest)


def check_travel(records: Sequence[Record]) -> None:
    """ShakeError where a table travels farther than any does: then its position is in another unit."""
    for record in records:
        travel = float(np.ptp(record.position))
        if travel > FARTHEST and not record.position_measured:
            raise ShakeError(
                f"{record.name}: the acceleration moves the table by {travel:.4g} m, farther than any table: in mm/s²? "
                "Import it again with --acceleration 'COL*0.001'"
            )
        if travel > FARTHEST:
            raise ShakeError(
                f"{record.name}: the position travels {travel:.4g} m, farther than any table: in millimetres? Import "
                "it again with --position 'COL*0.001', and --acceleration likewise if that is in mm/s²"
            )


def check_zero(records: Sequence[Record]) -> None:
    """ShakeError where no command ever comes near zero: then its zero is not that of the valve.

    Where the table stands still, which is what moves the zero, the regression of the slow velocity on the command
    tells.
    """
    low, high = (float(f([f(r.commands) for r in records])) for f in (np.min, np.max))
    if low * high <= 0.0 or min(abs(low), abs(high)) < ONE_SIDED * max(abs(low), abs(high)):
        return
    names = ", ".join(dict.fromkeys(r.name for r in records))
    said = f"{names}: the command stays within {low:.4g} … {high:.4g} and never comes near zero"
    if LIVE_ZERO[0] <= low and high <= LIVE_ZERO[1]:
        raise ShakeError(f"{said}: 4 to 20 mA, whose zero is 12 mA? Import it with --command 'COL*0.125-1.5'")
    zero = float(np.mean([standstill(r) for r in records]))
    raise ShakeError(
        f"{said}; the table stands still at about {zero:.4g}: import it with --command 'COL*1{-zero:+.4g}', or with "
        "the scale that makes it −1 … 1"
    )


def per_unit(record: Record, scale: float) -> Record:
    """The recording with its command in parts of a full scale."""
    return replace(record, commands=record.commands / scale, command_before=record.command_before / scale)


def standstill(record: Record) -> float:
    """Command at which the table stands still, whatever its zero, in the recorded unit."""
    u, v = (slow(x, record.sample_time)[record.start :] for x in (record.commands, record.velocity))
    gain = float(np.cov(u, v)[0, 1] / max(np.var(u), 1e-300))
    return float(np.mean(u) - np.mean(v) / gain) if gain else float(np.mean(u))


def slow(values: np.ndarray, sample_time: float) -> np.ndarray:
    """What of a signal is slower than SLOW, without phase."""
    return np.asarray(sosfiltfilt(butter(2, 2.0 * SLOW * sample_time, output="sos"), values))


def thinned(record: Record) -> Record:
    """A recording at no more than about FASTEST: means of command and acceleration, the position filtered.

    A hydraulic table moves far below; what a free run costs grows with the rate. A sharp filter of the acceleration
    would ring wherever the friction turns.
    """
    factor = int(1.05 / (FASTEST * record.sample_time))
    if factor < 2:
        return record
    count = len(record.commands) // factor
    commands = record.commands[: count * factor].reshape(count, factor).mean(axis=1)

    def fewer(values: np.ndarray) -> np.ndarray:
        return np.asarray(decimate(values, factor, ftype="fir", zero_phase=True)[:count])

    def averaged(values: np.ndarray) -> np.ndarray:
        return np.asarray(uniform_filter1d(values, factor, mode="nearest")[::factor][:count])

    return replace(
        record,
        sample_time=factor * record.sample_time,
        commands=commands,
        position=fewer(record.position),
        acceleration=None if record.acceleration is None else averaged(record.acceleration),
        pressure=None if record.pressure is None else averaged(record.pressure),
        past=record.past[::factor],
        valid=np.logical_and.reduce(record.whole[: count * factor].reshape(count, factor), axis=1),
    )


def without_glitches(record: Record, found: Sequence[np.ndarray]) -> Record:
    """The recording without glitches of its command."""
    return replace(record, commands=without(record.commands, found)) if found else record


def null_shift(record: Record) -> float:
    """Command at which the table stands still, with its sign turned [-]."""
    u, v = (slow(x, record.sample_time)[record.start :] for x in (record.commands, record.velocity))
    terms = np.column_stack([u, np.abs(u), np.ones_like(u)])
    gain, _, constant = np.linalg.lstsq(terms, v, rcond=None)[0]
    largest = float(np.max(np.abs(u)))
    return float(np.clip(constant / gain, -0.2 * largest, 0.2 * largest)) if gain > 0.0 else 0.0


def wandering(record: Record) -> np.ndarray:
    """The accelerometer's bias where it wanders, a cubic in time about the bias, shape (n,) [m/s²]; else zero.

    Beside a scale and a lag of either sensor: what these make of the motion has slow parts as well.
    """
    count, none = len(record.commands), np.zeros(len(record.commands))
    if record.acceleration is None or count * record.sample_time < LONG:
        return none
    basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), CUBIC)
    expected = np.gradient(record.velocity, record.sample_time)
    lagging = [np.gradient(each, record.sample_time) for each in (expected, record.acceleration)]
    terms = np.vstack([basis.T, expected, *lagging, record.acceleration - expected])
    terms = slow(terms, record.sample_time).T
    use = record.whole & (np.arange(count) >= record.start) & (np.arange(count) < count - record.start)
    found = np.linalg.lstsq(terms[use, :-1], terms[use, -1], rcond=None)[0]
    cubic = basis @ found[: CUBIC + 1]
    cubic -= float(np.mean(cubic))
    return cubic if float(np.std(cubic)) > WANDERS * record.acceleration_noise() else none


def without_offsets(record: Record) -> tuple[Record, Nuisance]:
    """A recording without its offsets, and these."""
    shift, bias, acceleration, wander = null_shift(record), None, record.acceleration, wandering(record)
    if acceleration is not None:
        seconds = len(acceleration) * record.sample_time
        bias = float(np.mean(acceleration) - (record.velocity[-1] - record.velocity[0]) / seconds)
        acceleration = acceleration - bias - wander
    moved = replace(
        record,
        commands=record.commands + shift,
        acceleration=acceleration,
        command_before=record.command_before + shift,
    )
    return moved, Nuisance(record.name, shift, bias, drift=float(np.ptp(wander)))


def prepared(estimation: Sequence[Record], validation: Sequence[Record]) -> Prepared:
    """Both sets of recordings at a rate that a fit takes, with the command per unit and without offsets."""
    both = [*estimation, *validation]
    places = unseen_glitches(both)
    both = [thinned(without_glitches(r, at)) for r, at in zip(both, places, strict=True)]
    check_travel(both)
    check_zero(both)
    scale = full_scale(both)
    scaled = [per_unit(r, scale) for r in both]
    sensors = sensor_pair(scaled)
    records, offsets = _without_offsets(scaled, sensors.delay, places)
    count = len(estimation)
    return Prepared(records[:count], records[count:], scale, offsets, sensors)


def _without_offsets(
    records: Sequence[Record], delay: float, places: Sequence[Sequence[np.ndarray]], first: int = 0
) -> tuple[list[Record], tuple[Nuisance, ...]]:
    """Recordings without their offsets, numbered from `first` on, and these; places : of the glitches taken out."""
    found = [without_offsets(timely(r, delay)) for r in records]
    runs = list(dict.fromkeys(r.name for r, _ in found))
    numbered = [replace(r, run=first + runs.index(r.name)) for r, _ in found]
    return numbered, tuple(replace(n, glitches=len(at)) for (_, n), at in zip(found, places, strict=True))
