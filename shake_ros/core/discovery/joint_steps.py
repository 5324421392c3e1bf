"""Several effects in one step: where no single one helps, though much is left above the noise.

A soft zone hides the mode of a specimen from every model that has only one of the two, and a dead time both. So where
the search comes to its end far above the noise without an effect, many are freed at once (joint_start.py), in runs that
are corrected towards the measurement; those that the fit holds on to are fitted together, and each has to prove its
worth.
"""

from __future__ import annotations

from dataclasses import replace

from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem
from shake_ros.core.discovery.shown_effects import shown_steps
from shake_ros.core.identification.joint_start import joint_start

HIGH_RATIO = 5.0  # ratio of the residual to the noise from which effects are looked for together
ALSO = ("specimen_resonance", "command_delay")  # from their middle trial: near nothing they have no meaning


def joint_steps(problem: SearchProblem, model: ModelStructure, current: ScoredFit) -> tuple[ForwardStep, ...]:
    """A step for each of the effects that only together make the model better; none where it is near the noise."""
    if current.estimation_cost < HIGH_RATIO**2 * problem.estimation.noise_cost():
        return ()
    problem.progress("fitting several effects at once", 0.0)
    part = {c.effect: c for c in model.candidates if c.together}
    part |= {c.effect: replace(c, together=c.trials[len(c.trials) // 2]) for c in model.candidates if c.effect in ALSO}
    guess = current.fit.table
    table, stay = joint_start(problem.estimation_pieces, model.free, part, guess)
    return shown_steps(problem, replace(model, shown=stay, fitted=table), current) if stay else ()
