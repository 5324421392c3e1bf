"""Do the stated standard errors cover the truth? What the study `interval_coverage` measures.

    ./shake campaign interval_coverage --out DIR [--set forms=drawn]

Recordings are made by another simulator, one table and one noise per seed, and it is counted how often the 90 %
interval (value ± 1.645 standard errors) holds the true value. A parameter at a bound has no standard error and is
counted apart. Wanted: 80 to 97 %. The fit starts from the truth, so that what is looked at is the interval and not
the search; as in the command, friction's transition velocity is freed where it explains much of what is left.

A true value exists only where the model can represent the truth. So the data come, by default, from a second writing
of the declared equations (plant/reference_model.py): no line of code in common, classical Runge–Kutta of 40 µs instead
of an error-controlled Dormand–Prince method, sensors with noise and steps of their own; but the same regularised
forms near rest, tanh(v/v_t) and the laminar stretch of the flow's root, and the valve's hysteresis as backlash.

`forms=other` takes the data from discovery/hidden_tables.py, where these three are other functions: friction
saturates linearly (`saturation`: width; by default that which takes as much off as the declared tanh does), the root
is rounded elsewhere, and the hysteresis is dry friction on the spool. There the fitted values are those with which
the declared forms come nearest to the other ones, and the relative error in the median is that shift; no interval that
counts noise covers it, and the longer the recordings, the less. `forms=drawn` are the same functions with widths drawn
for each table: that of friction evenly within the factor 2 ln 2 by which two forms that take the same off a step may
differ, in its logarithm; that of the root evenly up to the declared one. One choice of forms shifts a parameter to one
side on every table, so that an interval holds it always or never; how often it does is a question over many tables,
each with forms of its own. `forms=own` makes the data with the package's own simulator.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.discovery import hidden_tables as hidden
from benchmarks.plant import reference_model as reference
from shake_ros.declared import model_structure
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import Estimate, estimates, form_errors
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import unknown_name
from shake_ros.search.declared_fit import with_late_parameters
from shake_ros.search.problem import SearchProblem
from shake_ros.settings import load_search, load_table

SAME_DEFICIT = 2.0 * 0.693 * 1e-3  # ∫(1 − v/w) dv = ∫(1 − tanh(v/(1 mm/s))) dv for this width w [m/s]
QUANTILE = 1.645  # of the 90 % interval
FORMS = ("declared", "other", "drawn", "own")
SUBSTEPS = 25  # steps of the second writing per sample


def true_table(truth: hidden.Truth) -> TableParameters:
    """The package's table with the true values."""
    return load_table("bergamo").with_values({n: getattr(truth, f) for n, f in hidden.DECLARED.items()})


def measured(name: str, commands: np.ndarray, position: np.ndarray, acceleration: np.ndarray, seed: int) -> Record:
    """A recording with the sensors of hidden_tables.py: noise, then steps of the position."""
    rng = np.random.default_rng(seed)
    seen = position + hidden.POSITION_NOISE * rng.standard_normal(len(commands))
    seen = np.round(seen / hidden.POSITION_STEP) * hidden.POSITION_STEP
    felt = acceleration + hidden.ACCELERATION_NOISE * rng.standard_normal(len(commands))
    return Record(name, hidden.SAMPLE, commands, seen, felt)


def made(name: str, truth: hidden.Truth, commands: np.ndarray, seed: int, forms: str) -> Record:
    """A recording under commands that kept the table of hidden_tables.py centred."""
    if forms == "own":
        out = run(true_table(truth), commands, hidden.SAMPLE)
        return measured(name, commands, out[:, 0], out[:, 2], seed)
    values = {field: getattr(truth, field) for field in hidden.DECLARED.values()}
    declared = reference.constants()._replace(mass=truth.mass, **values)
    out = reference.fine_steps(commands, hidden.SAMPLE, declared, SUBSTEPS)
    return measured(name, commands, out[:, 0], out[:, 6], seed)


def with_drawn_forms(truth: hidden.Truth, seed: int) -> hidden.Truth:
    """The same table with widths of its own near rest: of the friction about the one it has, and of the flow root."""
    friction, root = np.random.default_rng([seed, 1]).uniform((-1.0, 0.0), 1.0)
    return truth._replace(
        saturation=truth.saturation * (2.0 * math.log(2.0)) ** friction,
        rounding=root * load_table("bergamo").value("valve.laminar_pressure"),
    )


def fitted(seed: int, length: float, forms: str, saturation: float) -> tuple[hidden.Truth, list[Estimate]]:
    """Truth and estimates of one seed."""
    truth = hidden.declared_truth(seed)._replace(saturation=saturation)
    if forms == "drawn":
        truth = with_drawn_forms(truth, seed)
    rng = np.random.default_rng(seed)
    records = []
    for name, excitation in hidden.excitations(seed, length).items():
        if not name.startswith("learn"):
            continue
        other = hidden.record(truth, excitation, 1.0, rng)
        if forms in ("other", "drawn"):
            records.append(Record(name, hidden.SAMPLE, other["command"], other["position"], other["acceleration"]))
        else:
            records.append(made(name, truth, other["command"], 7 * seed + len(name), forms))
    model = model_structure(true_table(truth))
    problem = SearchProblem.of(model, records, (), load_search(), lambda text, part: None)
    free = FreeParameters(model.table, model.free)
    result = fit(problem.estimation, free, free.start(), evaluations=20, tolerance=1e-6)
    result = with_late_parameters(problem, problem.scored(result)).fit
    return truth, estimates(result, problem.estimation.blocks(), form_errors(problem.estimation, result))


def measure(seed: int, length: float, forms: str, saturation: float | None) -> dict[str, Any]:
    """Which intervals of one seed hold the truth; a parameter at a bound has none and is left out.

    Parameters
    ----------
    length : scale of the recordings' durations. forms : who makes the data: declared, other, drawn or own.
    saturation : width of the data's dry friction [m/s], of the same deficit as the declared form's where None.
    """
    if forms not in FORMS:
        raise unknown_name("forms", forms, FORMS)
    truth, found = fitted(seed, length, forms, SAME_DEFICIT if saturation is None else saturation)
    own = [e for e in found if e.name in hidden.DECLARED and e.std_error]
    # the transition velocity has no true value where friction passes rest in another form
    return {
        "late": any(e.name not in hidden.DECLARED for e in found),
        "parameters": [_judged(e, float(getattr(truth, hidden.DECLARED[e.name]))) for e in own],
    }


def _judged(estimate: Estimate, true: float) -> dict[str, Any]:
    assert estimate.std_error
    error = estimate.value - true
    return {
        "parameter": estimate.name,
        "score": error / estimate.std_error,
        "relative_error": error / true,
        "covered": bool(abs(error) < QUANTILE * estimate.std_error),
        "covered_with_forms": bool(abs(error) < QUANTILE * (estimate.deviation or 0.0)),
    }
