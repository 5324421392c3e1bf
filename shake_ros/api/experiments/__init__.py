"""Experiments of the thesis's chapter 6: name → what runs it, `module:function`, and what it is in a line."""

from __future__ import annotations

from typing import NamedTuple


class ThesisExperiment(NamedTuple):
    """The function that runs an experiment and gives an `Experiment`, and a line about it."""

    run_by: str
    line: str


EXPERIMENTS: dict[str, ThesisExperiment] = {
    "sensitivity": ThesisExperiment("shake_ros.api.experiments.sensitivity:run", "6.3.4, what θ_5, θ_6 and θ_7 do"),
    "reduced_model": ThesisExperiment(
        "shake_ros.api.experiments.reduced_model:run", "6.3.7, 6.4.1, (6.36) over frequency"
    ),
    "parameters": ThesisExperiment("shake_ros.api.experiments.parameters:run", "6.3.3, 6.3.4, tables 6.5 to 6.8"),
    "neural_schedule": ThesisExperiment(
        "shake_ros.api.experiments.neural_schedule:run", "6.3.5, parameters scheduled by a neural network"
    ),
    "bulk_modulus": ThesisExperiment("shake_ros.api.experiments.bulk_modulus:run", "6.3.6, table 6.10, the soft zone"),
    "controllers": ThesisExperiment("shake_ros.api.experiments.controllers:run", "6.4.2–6.4.5, the three controllers"),
}
