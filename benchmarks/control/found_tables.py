"""Tracking on hidden tables with the models found of them: python -m benchmarks.control.found_tables --fits DIR.

The tables are those of benchmarks.discovery.hidden_tables, an independent simulator: half the catalogue's bulk modulus
and every listed effect at 30 % of the acceleration, three pairs, and dead times up to 6 ms. The question is the loop,
not the search: the models come from a fit that is told what was hidden and starts at the true values, on 7 s of noisy
recordings; the declared model is fitted to the same ones without it. What differs between the found model and the
table is then the noise's part and the simulators' (friction near rest, the valve's hysteresis). Fits and figures are
kept in DIR; --kept prints and --save writes those that are there.

The loop is closed on the table at rest 2 mm aside, with the pressures that hold it, and settles before the motion: what
it does when it is let go is shown by its largest distance, and counts as no error of the motion. Then an earthquake of
3 m/s² is followed on position with 8 µm of noise and 4.6 µm steps; a command acts one sample late, and
then the table's own dead time. Each law and observer carries (a) the declared model, (b) the extended one, (c) the
extended one with the observer and gains that `tune` makes for it. Errors are rms errors of position, velocity and
acceleration over that of the reference, in per cent.

Two measures stand beside them. A loop rings where the part of the acceleration's error above 15 Hz, where the reference
has nothing, has in some half second an rms above RINGING times the reference's whole rms while the valve is free, or
where the acceleration has AT_REST of it in the half second of rest at the end. The valve cannot follow where the
command that the extended model needs is at its limit for more than SATURATED of the time.

A table behind backlash is struck by its rod at each reversal of the force, whatever the loop. What that alone makes of
it is shown by the errors behind a rod that follows the reference exactly, as no loop does.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks.control.hidden_loop import closed_loop
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.tune_table import tune_table
from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.metrics import ASIDE, SETTLING, come_to_rest, ringing, settle_first, still_moving
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.control.robust import Uncertainty
from shake_ros.control.trials import AT_REST
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import covariance
from shake_ros.physics.plant.parameters import FIELDS, FULL_LAYOUT, TableParameters
from shake_ros.recordings.reference_file import build_program
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.settings import load_table, load_variant

LENGTH = 0.5  # of the recordings, 1: 7 + 7.5 s
SHORT = 0.2  # the same, of those that set an effect's strength
MODULUS = 0.5 * 1.16e9  # [Pa]
SEVERITY = 0.3
THREE_SEEDS = ("soft_zone", "supply_droop", "specimen_resonance")
DELAYS = (1.5e-3, 3.0e-3, 5.0e-3, 6.0e-3)  # [s]
PAIRS = (("soft_zone", "specimen_resonance"), ("supply_droop", "spool_deadband"), ("turbulent_leakage", "slow_valve"))
SECONDS = 6.0  # of the earthquake, its strongest part
RINGING = 0.5  # see above
SATURATED = 0.005
STRUCK = 100  # steps a sample of a table behind backlash
LOOPS = ("declared", "extended", "with gains")
EVALUATIONS = 6  # trial points of a fit


STRENGTHS = {"position_dependent_friction": "curvature"}  # where it is not the first of the package's
COMPANIONS = {  # the other parameters of effects: names of the package → fields of Truth
    "effects.supply_droop.time_constant": "droop_time",
    "effects.entrained_air.polytropic_exponent": "polytropic",
    "effects.soft_zone.threshold": "soft_edge",
    "effects.soft_zone.sharpness": "soft_sharpness",
    "effects.film_friction.full_film_velocity": "film_velocity",
    "effects.film_friction.time_constant": "film_time",
    "effects.specimen_resonance.frequency": "specimen_frequency",
    "effects.specimen_resonance.damping": "specimen_damping",
    "effects.coupling_backlash.stiffness": "contact_stiffness",
    "effects.coupling_backlash.rod_mass": "rod_mass",
    "effects.base_flexibility.frequency": "base_frequency",
    "effects.base_flexibility.damping": "base_damping",
}
WITHOUT_FIELD = {"effects.spool_deadband.closed": 0.0}  # the hidden valve keeps the underlap at its centre


@dataclass(frozen=True)
class Case:
    """A hidden table: what is in it, the seed of the rest, and a dead time that is given [s]."""

    effects: tuple[str, ...]
    seed: int
    delay: float = 0.0

    @property
    def key(self) -> str:
        """Name of its file."""
        return "+".join(self.effects) + (f"_{1e3 * self.delay:g}ms" if self.delay else "") + f"_{self.seed}"


def cases() -> list[Case]:
    """Those that matter most first."""
    found = [Case((effect,), seed) for effect in THREE_SEEDS for seed in (1, 2, 3)]
    found += [Case(("command_delay",), 1 + i, delay) for i, delay in enumerate(DELAYS)]
    found += [Case(pair, 1) for pair in PAIRS]
    listed = [name for name, effect in hidden.HIDDEN.items() if effect.listed]
    return found + [Case((e,), 1) for e in listed if e not in (*THREE_SEEDS, "command_delay")]


def truth_of(case: Case) -> hidden.Truth:
    """The table of a case."""
    commands = hidden.excitations(case.seed, SHORT)
    table = hidden.declared_truth(case.seed)._replace(modulus=MODULUS, command_delay=case.delay)
    for effect in case.effects if not case.delay else ():
        table = hidden.with_effect(table, effect, SEVERITY, commands, case.seed)
    return table


def records_of(case: Case, truth: hidden.Truth, commands: dict[str, np.ndarray]) -> list[Record]:
    """The recordings to learn from."""
    rng = np.random.default_rng([case.seed, *case.key.encode()])
    made = {n: hidden.record(truth, u, 1.0, rng) for n, u in commands.items() if n.startswith("learn")}
    return [Record(n, hidden.SAMPLE, m["command"], m["position"], m["acceleration"]) for n, m in made.items()]


def effect_values(truth: hidden.Truth, effects: tuple[str, ...]) -> dict[str, float]:
    """The true values of effects, by the package's names."""
    found = {}
    for effect in effects:
        found[f"effects.{effect}.{STRENGTHS.get(effect) or effect_candidate(effect)}"] = getattr(truth, effect)
        found |= {name: getattr(truth, there) for name, there in COMPANIONS.items() if name.split(".")[1] == effect}
        found |= {name: value for name, value in WITHOUT_FIELD.items() if name.split(".")[1] == effect}
    return found


def effect_candidate(effect: str) -> str:
    """The name of an effect's strength."""
    return next(c for c in effect_candidates() if c.effect == effect).strength.name.rpartition(".")[2]


def freed(effects: Sequence[CandidateEffect]) -> list[FreeParameter]:
    """The parameters of effects, within the quantities' bounds: those of the search are no matter of the loop."""
    bounds = {p.name: FIELDS[p.name].metadata for effect in effects for p in effect.free}
    return [replace(p, low=bounds[p.name]["low"], high=bounds[p.name]["high"]) for e in effects for p in e.free]


def fitted(start: TableParameters, effects: tuple[str, ...], records: list[Record]) -> tuple[Fit, np.ndarray]:
    """The fit with the structure given, and the covariance of its x."""
    chosen = [c for c in effect_candidates() if c.effect in effects]
    free = FreeParameters(start, free_parameters()).extended(freed(chosen))
    problem = RecordingProblem(records)
    result = fit(problem, free, free.start(), evaluations=EVALUATIONS)
    return result, covariance(result, problem.blocks())


def make_fit(case: Case, folder: Path) -> dict[str, Any]:
    """Truth, declared and extended table of a case with the extended one's uncertainty; read where it is there."""
    path = folder / f"{case.key}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    began = time.perf_counter()
    commands = hidden.excitations(case.seed, LENGTH)
    truth = truth_of(case)
    known = {name: getattr(truth, name_there) for name, name_there in hidden.DECLARED.items()}
    start = load_table("bergamo").with_values(known)
    records = records_of(case, truth, commands)
    declared, _ = fitted(start, (), records)
    base = declared.table
    extended, spread = fitted(start.with_values(effect_values(truth, case.effects)), case.effects, records)
    scale = extended.free.scale
    content = {
        "truth": truth._asdict(),
        "declared": base.to_mapping(),
        "extended": extended.table.to_mapping(),
        "names": list(extended.free.names),
        "covariance": np.nan_to_num(spread * scale * scale[:, None]).tolist(),
        "cost": [declared.cost, extended.cost],
    }
    path.write_text(json.dumps(content), encoding="utf-8")
    took = time.perf_counter() - began
    print(f"{case.key:34s} cost {declared.cost:9.0f} → {extended.cost:9.0f} in {took:.0f} s", flush=True)
    return content


def motion() -> np.ndarray:
    """The earthquake's strongest part, faded to rest at mid-stroke, behind the time to settle, (n, 3)."""
    rows = build_program("earthquake", hidden.SAMPLE).samples(0, round(SECONDS / hidden.SAMPLE))
    return settle_first(come_to_rest(rows, hidden.SAMPLE), hidden.SAMPLE)


def followed(truth: hidden.Truth, observer: Observer, law: Controller, reference: np.ndarray, seed: int) -> ClosedLoop:
    """A run on the hidden table, whose position alone is measured, begun at rest aside."""
    noise = np.full((len(reference), 4), np.nan)
    noise[:, 0] = hidden.POSITION_NOISE * np.random.default_rng(seed).standard_normal(len(reference))
    return closed_loop(truth, observer, law, reference, noise, start=ASIDE)


def as_configured(law: str, observer: str, model: TableParameters) -> tuple[Observer, Controller]:
    """The package's configurations on a model."""
    kind, parameters = load_variant("controller", law, CONTROLLERS)
    seer, own = load_variant("observer", observer, OBSERVERS)
    return Observer(seer, own, hidden.SAMPLE, model), Controller(kind, parameters, hidden.SAMPLE, model)


def figures(run: ClosedLoop) -> dict[str, float | bool]:
    """Errors [%], ringing, movement at rest, share of the time at the limit [%], largest distance while it settled
    [mm], and whether it rings."""
    let_go = 1e3 * float(np.nanmax(np.abs(run.truth[: round(SETTLING / run.sample_time), 0])))
    run = run.after(SETTLING)
    lost = not np.isfinite(run.truth).all()
    errors = [math.inf] * 3 if lost else (100.0 * run.tracking_error()).tolist()
    shaken, still = ringing(run), still_moving(run)
    limited = float(np.mean(np.abs(run.command) >= 1.0 - 1e-9))
    rings = (shaken > RINGING and limited < SATURATED) or still > AT_REST
    names = ("x", "v", "a", "ringing", "still", "limited", "let_go")
    return dict(zip(names, (*errors, shaken, still, 100.0 * limited, let_go), strict=True)) | {"rings": bool(rings)}


def row_of(case: Case, folder: Path, law: str) -> dict[str, Any]:
    """The figures of a case; read where they are there."""
    path = folder / f"{case.key}.row"
    if not path.exists():
        path.write_text(json.dumps(tried(make_fit(case, folder), law, case.seed)), encoding="utf-8")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def tried(content: dict[str, Any], law: str, seed: int) -> dict[str, Any]:
    """The three loops of a table."""
    truth = hidden.Truth(**content["truth"])
    reference = motion()
    declared, extended = table_of(content, "declared"), table_of(content, "extended")
    known = Uncertainty(tuple(content["names"]), np.array(content["covariance"]))
    began = time.process_time()
    tuned = tune_table(extended, uncertainty=known, progress=False)
    took = time.process_time() - began
    loops = {
        "declared": as_configured(law, "model", declared),
        "extended": as_configured(law, "model", extended),
        "with gains": tuned.loop(),
    }
    found: dict[str, Any] = {n: figures(followed(truth, *loop, reference, seed)) for n, loop in loops.items()}
    virtual = loops["with gains"][1].virtual
    assert virtual is not None
    needed = float(np.mean(np.abs(virtual.follow(reference)[0]) >= 1.0 - 1e-9))
    return found | {
        "law": tuned.best.kind,
        "bandwidth": tuned.best.design.bandwidth,
        "sound": tuned.sound,
        "needed": 100.0 * needed,
        "processor": took,
    }


@numba.njit(cache=True)
def struck(t: Any, rod: np.ndarray, dt: float, substeps: int) -> np.ndarray:
    """Position, velocity and acceleration of a table behind backlash, whose rod moves as told, shape (n, 3)."""
    out, h = np.zeros_like(rod), dt / substeps
    mass, half = t.mass - t.rod_mass, 0.5 * t.coupling_backlash
    damping = 2.0 * t.contact_damping * math.sqrt(t.contact_stiffness * t.rod_mass)
    x, v = rod[0, 0], 0.0
    for i in range(len(rod)):
        ahead = rod[min(i + 1, len(rod) - 1)]
        for j in range(substeps):
            part = j / substeps
            apart = (1.0 - part) * rod[i, 0] + part * ahead[0] - x
            faster = (1.0 - part) * rod[i, 1] + part * ahead[1] - v
            force = 0.0
            if apart > half:
                force = max(t.contact_stiffness * (apart - half) + damping * faster, 0.0)
            elif apart < -half:
                force = min(t.contact_stiffness * (apart + half) + damping * faster, 0.0)
            if j == 0:
                out[i] = x, v, force / mass
            v += h * force / mass
            x += h * v
    return out


def behind_backlash(case: Case) -> dict[str, float | bool]:
    """Figures of a table behind backlash whose rod follows the reference exactly."""
    reference = motion()
    moved = struck(truth_of(case), reference, hidden.SAMPLE, STRUCK)
    none = np.zeros(len(reference))
    return figures(ClosedLoop(hidden.SAMPLE, reference, moved, moved, none, np.zeros((len(reference), 5))))


def line_of(key: str, row: dict[str, Any]) -> str:
    """A line of the table."""
    text = f"{key:34s}"
    for name in LOOPS:
        f = row[name]
        text += f" {f['x']:6.2f} {f['v']:6.2f} {f['a']:7.1f}{'*' if f['rings'] else ' '}"
    return f"{text} {row['needed']:6.1f}  {row['law']} {row['bandwidth']:.0f} rad/s"


def summary(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Median and worst of the tables that the valve can follow, and what rings."""
    free = [row for row in rows.values() if row["needed"] <= 100.0 * SATURATED]
    lines = [f"{len(rows)} tables, of which the valve can follow on {len(free)}"]
    for name in LOOPS:
        errors = np.array([[row[name][c] for c in "xva"] for row in free])
        median, worst = np.median(errors, axis=0), np.max(errors, axis=0)
        rings = [key for key, row in rows.items() if row[name]["rings"]]
        lines.append(
            f"{name:12s} median {median[0]:.2f} / {median[1]:.2f} / {median[2]:.1f} %, "
            f"worst {worst[0]:.2f} / {worst[1]:.2f} / {worst[2]:.1f} %, rings on {len(rings)}: {', '.join(rings)}"
        )
    key, row = max(rows.items(), key=lambda item: float(item[1][LOOPS[-1]]["let_go"]))
    lines.append(f"while the loop with gains settled the table moved at most {row[LOOPS[-1]]['let_go']:.1f} mm ({key})")
    sound = sum(row["sound"] for row in rows.values())
    lines.append(f"tune calls its gains sound, on the table and all its neighbours, on {sound} of {len(rows)}")
    took = [row["processor"] for row in rows.values() if "processor" in row]
    if took:
        lines.append(f"tuning took {np.median(took):.1f} s of processor time in the median of {len(took)}")
    return lines


def table_of(content: dict[str, Any], name: str) -> TableParameters:
    """A fitted table of a case."""
    return FULL_LAYOUT.table(content[name], name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fits", type=Path, required=True, metavar="DIR", help="where fits are kept")
    parser.add_argument("--law", default="super_twisting_tuned", help="of the first two loops (config/controller)")
    parser.add_argument("--only", nargs="+", metavar="EFFECT", help="tables with these effects alone")
    parser.add_argument("--kept", action="store_true", help="only tables whose figures are in DIR")
    parser.add_argument("--save", action="store_true", help="write found_tables.txt")
    given = parser.parse_args()
    given.fits.mkdir(parents=True, exist_ok=True)
    head = "".join(f"{name + ' x / v / a [%]':>25s}" for name in LOOPS)
    lines = [f"{'hidden':32s}{head}  limit [%]  law of the gains  (* rings)"]
    print(lines[0])
    rows = {}
    for case in cases():
        if given.only and not set(given.only) & set(case.effects):
            continue
        if given.kept and not (given.fits / f"{case.key}.row").exists():
            continue
        rows[case.key] = row_of(case, given.fits, given.law)
        lines.append(line_of(case.key, rows[case.key]))
        print(lines[-1], flush=True)
    lines += summary(rows)
    for case in cases():
        if case.key in rows and "coupling_backlash" in case.effects:
            alone = behind_backlash(case)
            errors = f"{alone['x']:.2f} / {alone['v']:.2f} / {alone['a']:.0f} %"
            said = "it rings" if alone["rings"] else "it does not ring"
            lines.append(f"{case.key}: behind a rod that follows the reference exactly {errors}, {said}")
    missing = [case.key for case in cases() if case.key not in rows]
    if missing:
        lines.append(f"not run: {', '.join(missing)}")
    print("\n".join(lines[len(rows) + 1 :]))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
