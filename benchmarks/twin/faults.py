"""Does the twin notice a fault and name it? What the studies `follow` and `follow_nothing` measure.

    ./shake campaign follow --out DIR
    ./shake campaign follow_nothing --out DIR

Tables of hidden_tables.py and foreign_tables.py, which share nothing with the package. The twin gets a table's numbers
with the errors of a fit, three motions of the sound table, and then motions of the same table with one fault
that changes the acceleration by a given share: at full size from one motion to the next, or growing from motion to
motion. Beside it a plain baseline on the same samples: a threshold on the tracking error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.discovery import foreign_tables as foreign
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.read import Recordings, recording
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table
from shake_ros.twin.change import HOUR
from shake_ros.twin.follow import Following, follow
from shake_ros.twin.naming import free_run_errors
from shake_ros.twin.twin import INTERVAL, PAUSED, WATCHING, Change

FIT_ERROR = 0.02  # standard deviation of a found table's numbers about the true ones, relative
SECONDS = 8.6  # of a motion: four windows, and the start in which the state is found
BEFORE, AFTER = 3, 2  # motions of the sound table, and with the fault at full size
WARMING = {"modulus": -0.05, "internal": 0.3, "viscous": -0.3}  # logarithms of what 10 K in an hour change [1/h]
SOUND = 24  # motions of a sound table that are watched behind the first ones
GROWING = 4  # motions over which a slow fault grows
RUMBLE = 0.01  # random force of the table with process noise, in parts of what its supply can push
SUBSTEPS = 20  # integration steps in a sample
SPECIMEN = 100.0  # that swings on one of the tables [kg]
NUMBERS = {  # names of the package → fields of the truth
    **hidden.DECLARED,
    "body.piston_area": "area",
    "body.cylinder_volume": "volume",
    "supply.supply_pressure": "supply",
    "valve.natural_frequency": "omega",
    "valve.damping": "damping",
    "valve.underlap": "underlap",
    "valve.hysteresis": "spool_friction",
}
EXACT = {"body.piston_area", "body.cylinder_volume", "valve.underlap", "valve.hysteresis"}
EFFECTS = {
    "effects.valve_null_shift.offset": "valve_null_shift",
    "effects.payload_error.mass": "payload_error",
    "effects.specimen_resonance.mass": "specimen_resonance",
    "effects.specimen_resonance.frequency": "specimen_frequency",
    "effects.specimen_resonance.damping": "specimen_damping",
    "effects.command_delay.delay": "command_delay",
    "effects.accelerometer_scale.error": "accelerometer_scale",
    "effects.accelerometer_bias.bias": "accelerometer_bias",
}


@dataclass(frozen=True)
class Fault:
    """A fault. field : of the truth. names : that are right. factor : whether it scales the field, up or down."""

    field: str
    names: tuple[str, ...]
    factor: tuple[float, ...] = ()


FAULTS = {
    "flow_gain": Fault("flow", ("valve.flow_coefficient",), (-1.0, 1.0)),
    "bulk_modulus": Fault("modulus", ("bulk_modulus.modulus",), (-1.0, 1.0)),
    "internal_leakage": Fault("internal", ("leakage.internal",), (1.0,)),
    "coulomb_friction": Fault("coulomb", ("friction.coulomb_level",), (-1.0, 1.0)),
    "viscous_friction": Fault("viscous", ("friction.viscous",), (1.0,)),
    "supply_pressure": Fault("supply", ("supply.supply_pressure",), (-1.0,)),
    "specimen_mass": Fault("payload_error", ("payload_error",)),
    "accelerometer_lag": Fault("accelerometer_lag", ("accelerometer_lag", "sensor.delay")),
    **{
        effect: Fault(effect, (effect,))
        for effect in (
            *("valve_null_shift", "command_delay", "accelerometer_scale", "accelerometer_bias"),
            *("soft_zone", "spool_hysteresis", "asymmetric_flow_gain", "coupling_backlash", "entrained_air"),
            *("slow_valve", "friction_bump"),
        )
    },
}
LARGEST = 8.0  # factor of a number
TRUE = hidden.DECLARED | EFFECTS | {"supply.supply_pressure": "supply"}
RECOVERED = 1.3  # times the sound table's error, up to which the model follows the fault
WINDOW, PLAIN = 2.0, 4.0  # of the baseline [s]; its threshold above the mean, in standard deviations


@dataclass(frozen=True)
class Bench:
    """A table in its laboratory."""

    truth: hidden.Truth
    table: TableParameters
    laboratory: foreign.Laboratory


def bench(table: str, seed: int) -> Bench:
    """A table of a kind: bergamo, specimen (a swinging one, and process noise), foreign (another laboratory's)."""
    rng = np.random.default_rng([seed, 46])
    if table == "foreign":
        truth = foreign.table(rng)
        laboratory = foreign.laboratory(truth, rng)
        truth = as_played(truth, laboratory)
        return Bench(truth, _found(truth, rng), laboratory)
    truth = hidden.declared_truth(seed)
    if table == "specimen":
        force = RUMBLE * (truth.supply - truth.tank) * truth.area
        frequency = float(rng.uniform(4.0, 9.0))
        truth = truth._replace(rumble=force, specimen_resonance=SPECIMEN, specimen_frequency=frequency)
    plain = foreign.Laboratory(1.0 / hidden.SAMPLE, 1.0, 0.0, 0.0, 0.0, 1.0 / truth.velocity_gain, hidden.LOOP_GAIN)
    return Bench(truth, _found(truth, rng), plain)


def _found(truth: hidden.Truth, rng: Any) -> TableParameters:
    """The table as a fit leaves it."""
    own = {n: getattr(truth, f) * (1.0 if n in EXACT else _about_one(rng)) for n, f in NUMBERS.items()}
    own |= {n: getattr(truth, f) for n, f in EFFECTS.items() if getattr(truth, f) != 0.0 and "specimen" not in n}
    if truth.specimen_resonance:
        own |= {n: getattr(truth, f) * _about_one(rng) for n, f in EFFECTS.items() if "specimen" in n}
    own |= {"body.table_mass": truth.mass, "body.specimen_mass": 0.0}
    return load_table("bergamo").with_values(own)


def _about_one(rng: Any) -> float:
    return float(np.exp(FIT_ERROR * rng.standard_normal()))


def played(
    b: Bench, truth: hidden.Truth, motion: str, name: str, rng: Any, noise: float = 1.0, level: float = 1.0
) -> tuple[Recordings, np.ndarray]:
    """One motion: what the laboratory records, and the tracking error at its samples over the motion's size, (n,)."""
    lab = b.laboratory
    # the truth's own gain sizes the motion: that of the sound table, whatever fails
    wanted = level * foreign.reference(f"learn_{motion}", b.truth, lab.rate, SECONDS, rng)
    if lab.anti_alias:
        out = _foreign(b, truth, wanted, rng, noise)
    else:
        excitation = lab.feedforward * wanted[:, 1] + lab.feedback * wanted[:, 0]
        made = hidden.record(truth, excitation, noise, rng, SUBSTEPS)
        out = np.column_stack([made["command"], made["position"], made["acceleration"]])
    times = np.arange(len(out)) / lab.rate
    run = recording(name, times, *out[:, :2].T, acceleration=out[:, 2])
    return run, (out[:, 1] - wanted[:, 0]) / float(np.std(wanted[:, 0]))


def _foreign(b: Bench, truth: hidden.Truth, wanted: np.ndarray, rng: Any, noise: float) -> np.ndarray:
    lab, out = b.laboratory, np.zeros((len(wanted), 3))
    substeps = math.ceil(1.0 / lab.rate / foreign.STEP)
    scatter = noise * lab.noise * rng.standard_normal((len(wanted), 1))
    chain = foreign.butterworth(lab.anti_alias, 1.0 / lab.rate / substeps)
    foreign.drive(truth, lab, wanted, scatter, 0.0, substeps, chain, out)
    size = 0.004 * float(np.std(out[:, 2])) + 0.004
    out[:, 2] += truth.accelerometer_bias + noise * size * rng.standard_normal(len(wanted))
    return out


def as_played(truth: hidden.Truth, lab: foreign.Laboratory) -> hidden.Truth:
    """A truth with the delay that its simulator plays: whole integration steps, in a laboratory one sample at most."""
    step = 1.0 / lab.rate / (math.ceil(1.0 / lab.rate / foreign.STEP) if lab.anti_alias else SUBSTEPS)
    late = step * round(truth.command_delay / step)
    return truth._replace(command_delay=min(late, 1.0 / lab.rate) if lab.anti_alias else late)


def changed(b: Bench, fault: Fault, strength: float, sign: float) -> hidden.Truth:
    """The truth with a fault: a factor exp(± strength) of its field, or its value ± strength."""
    now = getattr(b.truth, fault.field)
    value = now * math.exp(sign * strength) if fault.factor else now + sign * strength
    return as_played(b.truth._replace(**{fault.field: value}), b.laboratory)


def strength_of(b: Bench, fault: Fault, sign: float, size: float, motion: str, seed: int) -> float:
    """The strength that changes the acceleration of a motion by a share, by bisection; at most its range's end."""

    def felt(truth: hidden.Truth) -> np.ndarray:
        ((run,), _) = played(b, truth, motion, "none", np.random.default_rng([seed, 1]), 0.0)
        assert run.acceleration is not None
        return run.acceleration

    kind = None if fault.factor else hidden.HIDDEN[fault.field]
    low, high = (math.log(1e-3), math.log(math.log(LARGEST))) if kind is None else map(math.log, (kind.low, kind.high))
    sound = felt(b.truth._replace(rumble=0.0))
    for _ in range(9):
        middle = 0.5 * (low + high)
        off = felt(changed(b, fault, math.exp(middle), sign)._replace(rumble=0.0)) - sound
        low, high = (middle, high) if float(np.std(off) / np.std(sound)) < size else (low, middle)
    return math.exp(low)


def measure(seed: int, table: str, fault: str, size: float, way: str, motion: str) -> dict[str, Any]:
    """One fault on one table.

    Parameters
    ----------
    table : as in `bench`. fault : of FAULTS. size : change of the acceleration [-]. way : abrupt or slow.
    motion : quake or random.
    """
    b, kind = bench(table, seed), FAULTS[fault]
    rng = np.random.default_rng([seed, *fault.encode(), round(100 * size), len(way), len(motion)])
    signs = kind.factor or ((-1.0, 1.0) if hidden.HIDDEN[kind.field].signed else (1.0,))
    sign = float(rng.choice(signs))
    strength = strength_of(b, kind, sign, size, motion, seed)
    growth = np.linspace(0.0, 1.0, GROWING + 1)[1:-1] if way == "slow" else np.zeros(0)
    shares = [*([0.0] * BEFORE), *growth, *([1.0] * AFTER)]
    runs, errors = list[Recordings](), list[np.ndarray]()
    for i, share in enumerate(shares):
        truth = changed(b, kind, share * strength, sign) if share else b.truth
        run, error = played(b, truth, motion, f"run_{i:02d}", rng)
        runs.append(run)
        errors.append(error)
    began = time.process_time()
    found = follow([r for run in runs for r in run], b.table, progress=False)
    load = (time.process_time() - began) / (SECONDS * len(runs))
    faulty = changed(b, kind, strength, sign)
    new, _ = played(b, faulty, motion, "new", rng)
    own, _ = played(b, b.truth, motion, "own", rng)
    return {
        **judged(found, kind, BEFORE),
        **after(found, new, own),
        "coverage": covered(found, faulty, b.truth, len(shares) - 1),
        **baseline(errors, b.laboratory.rate, BEFORE),
        "strength": sign * strength,
        "load": load,
    }


def nothing(seed: int, table: str) -> dict[str, Any]:
    """A sound table under motions of either kind at any level while its oil warms: false alarms, and the intervals."""
    b, rng = bench(table, seed), np.random.default_rng([seed, 47])
    runs, errors, truth = list[Recordings](), list[np.ndarray](), b.truth
    for i in range(BEFORE + SOUND):
        motion, level = ("quake", "random")[int(rng.integers(2))], float(rng.uniform(0.5, 1.0))
        truth = warmed(b.truth, max(i - BEFORE + 1, 0) * SECONDS / HOUR)
        run, error = played(b, truth, motion, f"run_{i:02d}", rng, level=level if i >= BEFORE else 1.0)
        runs.append(run)
        errors.append(error)
    began = time.process_time()
    found = follow([r for run in runs for r in run], b.table, progress=False)
    load = (time.process_time() - began) / (SECONDS * len(runs))
    watched = [w for w in found.known if w.state == WATCHING]
    return {
        "alarms": len(found.changes),
        "alarm": bool(found.changes),
        "named": [named_of(c) for c in found.changes],
        "hours": sum((w.stamp - w.start) * 1e-9 for w in watched) / HOUR,
        "coverage": covered(found, truth, b.truth, BEFORE + SOUND - 1),
        "load": load,
        **baseline(errors, b.laboratory.rate, BEFORE),
    }


def warmed(truth: hidden.Truth, hours: float) -> hidden.Truth:
    """A truth whose oil warms."""
    return truth._replace(**{f: getattr(truth, f) * math.exp(part * hours) for f, part in WARMING.items()})


def number(recording: str) -> int:
    """Number of a motion."""
    return int(recording.rpartition("_")[2])


def judged(found: Following, fault: Fault, first: int) -> dict[str, Any]:
    """What was noticed since the motion with a number, and how it was named: the first change that counts.

    Whether it or a later one names the fault comes beside: one that grows may only then be explained.
    """
    early = [c for c in found.changes if number(c.recording) < first]
    late = [c for c in found.changes if number(c.recording) >= first]
    answer = answer_of(late[0], fault) if late else "missed"
    noticed = [w for w in found.windows if late and w.stamp == late[0].noticed]
    motion = [w for w in found.windows if number(w.recording) >= first and late and w.stamp <= late[0].noticed]
    return {
        "noticed": bool(late),
        "answer": answer,
        "right": answer == "right",
        "among": answer == "among",
        "wrong": answer == "wrong",
        "at_last": any(answer_of(c, fault) in ("right", "among") for c in late),
        "named": named_of(late[0]) if late else "–",
        "all": [named_of(c) for c in found.changes],
        "early": bool(early),
        "delay": sum((w.stamp - w.start) * 1e-9 for w in motion) if noticed else None,
    }


def answer_of(change: Change, fault: Fault) -> str:
    """How right an answer is: right, among (one of several), wrong, unexplained."""
    if not change.named.explained:
        return "right" if fault.field == "friction_bump" else "unexplained"
    names = [h.name for h in (change.named.best, *change.named.rivals)]
    if names[0] in fault.names and len(names) == 1:
        return "right"
    return "among" if set(names) & set(fault.names) else "wrong"


def named_of(change: Change) -> str:
    """The answer in words."""
    names = sorted(h.name for h in (change.named.best, *change.named.rivals))
    return " | ".join(names) if change.named.explained else "unexplained"


def after(found: Following, new: Recordings, own: Recordings) -> dict[str, Any]:
    """Error of the acceleration in free runs of a motion with the fault, over that of the sound table before."""
    vectors = np.array([t.vector() for t in (found.reference, found.table)])
    records = [r for run in (new, own) for r in run.records()]
    sound = free_run_errors(vectors[:1], records[1:])[0]
    without, left = free_run_errors(vectors, records[:1]) / sound
    return {"sound_error": sound, "without": without, "with": left, "recovered": bool(left <= RECOVERED)}


def covered(found: Following, truth: hidden.Truth, sound: hidden.Truth, motion: int) -> list[dict[str, Any]]:
    """Whether the 90 % intervals at a motion's end hold the true numbers, and their change since the reference."""
    last = [w for w in found.known if number(w.recording) == motion and w.state != PAUSED]
    if not last:
        return []
    rows = zip(found.names, found.known[0].values, last[-1].values, last[-1].deviations, last[-1].moved, strict=True)
    return [
        {
            "parameter": name,
            "value_covered": bool(abs(value - getattr(truth, TRUE[name])) <= INTERVAL * deviation),
            "change_covered": bool(
                abs(value - first - (getattr(truth, TRUE[name]) - getattr(sound, TRUE[name]))) <= INTERVAL * moved
            ),
        }
        for name, first, value, deviation, moved in rows
        if name in TRUE
    ]


def baseline(errors: Sequence[np.ndarray], rate: float, first: int) -> dict[str, Any]:
    """A threshold on the tracking error's root mean square in windows of 2 s, set by the windows of the sound table."""
    size = round(WINDOW * rate)
    logs = [[math.log(float(np.std(e[k : k + size]))) for k in range(0, len(e) - size, size)] for e in errors]
    known = np.concatenate(logs[: first - 1])
    limit = float(np.mean(known) + PLAIN * np.std(known))
    over = [max(motion) > limit for motion in logs]
    return {"baseline_noticed": any(over[first:]), "baseline_early": over[first - 1]}
