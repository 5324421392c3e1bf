"""Does a fit with predictor runs too estimate parameters better where process noise acts? Which effects are named?

    python -m benchmarks.discovery.process_noise [--seeds 101:109] [--names 3]

Tables of hidden_tables.py, which shares nothing with the package, on which a random force acts that no command tells:
0, 60 and 180 N rms with a memory of 8 ms. First the declared model, of
which nothing is missing, is fitted to the free runs alone, and to free and predictor runs together (process_noise.py of
the package) where equal commands show process noise. Then, for so many seeds, `close_loop` is asked what is missing,
from six effects, with one or none hidden, free runs alone against both. The last output is in process_noise.txt.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.discovery import confusion
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.progress import Progress
from shake_ros.campaigns.report import Share
from shake_ros.declared import model_structure
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.fit.nuisances.equal_commands import FreeAndPredictor, process_noise
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.narrow_valleys import INJECTION, approached
from shake_ros.repair.close_loop import close_loop
from shake_ros.settings import load_search, load_table

FORCES = (0.0, 60.0, 180.0)  # [N rms]
AMONG = (
    "soft_zone",
    "spool_deadband",
    "specimen_resonance",
    "supply_droop",
    "friction_asymmetry",
    "entrained_air",
)
HIDDEN = ("none", "spool_deadband", "specimen_resonance")
SEVERITY, NAMES_FORCE = 0.1, 60.0  # relative change of the acceleration by the hidden effect; force where it hides [N]
NEVER = 1e9  # ratio from which process noise counts where it is not to


def quantities(values: dict[str, float]) -> dict[str, float]:
    """What the parameters mean: hydraulic frequency, its decay, velocity gain, friction at 0.1 m/s and at rest."""
    base = hidden.Truth()
    decay = 4.0 * values["modulus"] * (values["internal"] + 0.5 * values["external"]) / base.volume
    dry = values["coulomb"] + values["rise"] * math.exp(-0.1 * values["decay"])
    return {
        "hydraulic frequency": math.sqrt(values["modulus"]),
        "damping": decay + values["viscous"] / base.mass,
        "velocity gain": values["flow"],
        "friction, 0.1 m/s": dry + 0.1 * values["viscous"],
        "breakaway": values["coulomb"] + values["rise"],
    }


def errors(found: Fit, truth: hidden.Truth) -> dict[str, float]:
    """Relative error of each quantity."""
    values = dict(zip(found.free.names, (found.x * found.free.scale).tolist(), strict=True))
    told = quantities({field: values[name] for name, field in hidden.DECLARED.items()})
    true = quantities({field: getattr(truth, field) for field in hidden.DECLARED.values()})
    return {name: value / true[name] - 1.0 for name, value in told.items()}


def recordings(
    seed: int, truth: hidden.Truth, length: float = 1.0, effect: str = "none"
) -> tuple[list[Record], list[Record]]:
    """Those to learn from and those held out."""
    made = confusion.recordings(effect, seed, 1.0, truth, hidden.excitations(seed, length))
    learn, hold = ([r for n, r in made.items() if n.startswith(role)] for role in ("learn", "hold"))
    return learn, hold


def fitted(seed: int, force: float) -> tuple[float | None, dict[str, float], dict[str, float]]:
    """Ratio that equal commands show, errors of the fit to free runs, errors of the fit to both."""
    truth = hidden.declared_truth(seed)._replace(rumble=force)
    learn, hold = (RecordingProblem(records) for records in recordings(seed, truth))
    structure = model_structure(load_table("bergamo"))
    free = FreeParameters(structure.table, structure.free)
    alone = approached(learn, free, free.start(), tolerance=1e-6)
    ratio = process_noise([learn, hold], alone.vector, load_search().near_noise ** 2)
    if ratio is None:
        return None, errors(alone, truth), errors(alone, truth)
    both = fit(FreeAndPredictor(learn, INJECTION, alone.vector), free, alone.x, tolerance=1e-6)
    return ratio, errors(alone, truth), errors(both, truth)


def ratio_interval(alone: np.ndarray, both: np.ndarray, draws: int = 4000) -> str:
    """Rms of the one fit's errors over that of the other's with its 90 % interval, by drawing tables anew in pairs."""
    which = np.random.default_rng(0).integers(0, len(alone), (draws, len(alone)))
    ratios = np.sqrt(np.mean(both[which] ** 2, axis=1) / np.mean(alone[which] ** 2, axis=1))
    whole = math.sqrt(float(np.mean(both**2) / np.mean(alone**2)))
    low, high = np.quantile(ratios, (0.05, 0.95))
    return f"{whole:.2f} ({low:.2f} … {high:.2f})"


def parameter_table(seeds: Sequence[int]) -> None:
    """Print rms errors of the two fits."""
    print(f"Relative errors, rms over {len(seeds)} tables (seeds {seeds[0]} … {seeds[-1]}), of which nothing is hidden")
    print(f"{'force [N]':<11}{'shown':>7}  {'quantity':<22}{'free':>9}{'both':>9}   {'ratio (90 %)':<24}nearer by both")
    for force in FORCES:
        start = time.perf_counter()
        rows = [fitted(seed, force) for seed in seeds]
        shown = sum(ratio is not None for ratio, _, _ in rows)
        for name in rows[0][1]:
            alone, both = np.array([(free[name], both[name]) for _, free, both in rows]).T
            nearer, differ = int(np.sum(abs(both) < abs(alone))), int(np.sum(both != alone))
            part = str(Share(nearer, differ)) if differ else "the same fit"
            sizes = "".join(f"{100.0 * float(np.sqrt(np.mean(e**2))):>7.2f} %" for e in (alone, both))
            ratio = ratio_interval(alone, both) if differ else ""
            print(f"{force:<11g}{f'{shown}/{len(seeds)}':>7}  {name:<22}{sizes}   {ratio:<24}{part}")
        print(f"  [{time.perf_counter() - start:.0f} s]", flush=True)


def named(seed: int, effect: str, with_predictor: bool) -> tuple[str, ...]:
    """What close_loop adds."""
    commands = hidden.excitations(seed, 0.8)
    truth = confusion.truth(effect, SEVERITY, seed, commands)._replace(rumble=NAMES_FORCE)
    structure = replace(model_structure(load_table("bergamo")), candidates=confusion.candidates(AMONG))
    settings = load_search() if with_predictor else load_search().replace(process_noise=NEVER)
    with Progress("close_loop", shown=False) as silent:
        found = close_loop(structure, *recordings(seed, truth, 0.8, effect), settings, silent)
    return tuple(step.chosen.candidate.effect for step in found.search.steps)


def names_table(seeds: Sequence[int]) -> None:
    """Print what is named by free runs alone and by both."""
    print(
        f"\nNamed out of {len(AMONG)} with {NAMES_FORCE:g} N of process noise, {100 * SEVERITY:g} % of the acceleration"
    )
    for effect in HIDDEN:
        for seed in seeds:
            start = time.perf_counter()
            told = {by: ", ".join(named(seed, effect, by == "both")) or "nothing" for by in ("free", "both")}
            print(f"{effect:<20}seed {seed:<5}free: {told['free']:<30}both: {told['both']}", end="")
            print(f"   [{time.perf_counter() - start:.0f} s]", flush=True)


def main() -> None:
    """Print both tables."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--seeds", default="101:109", help="first seed and the one behind the last")
    command.add_argument("--names", type=int, default=0, help="seeds for which close_loop is asked, from the first on")
    given = command.parse_args()
    first, behind = (int(part) for part in given.seeds.split(":"))
    if first < behind:
        parameter_table(range(first, behind))
    if given.names:
        names_table(range(first, first + given.names))


if __name__ == "__main__":
    main()
