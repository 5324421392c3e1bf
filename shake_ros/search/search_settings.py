"""Every threshold of the search for missing effects; config/discovery/search.yaml gives each value with its reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from shake_ros.quantities import Parameters, ShakeError, check, quantity


@dataclass(frozen=True)
class SearchSettings(Parameters):
    """How hard the search looks and what it takes for an improvement.

    Costs are mean squares of weighted residuals. "Trial points" are those of one fit for which differences are
    simulated.
    """

    # what is fitted
    search_seconds: float = quantity("s", "estimation data that the search fits; the final model fits all", low=1.0)
    piece_seconds: float = quantity("s", "recordings on which functions are first tried", low=1.0)
    # parameters freed late
    late_gain: float = quantity("-", "part of what stands above the noise that freeing must take", low=0.0)
    # fits
    converged: float = quantity("-", "relative change at which a converged fit stops", low=1e-12, high=1.0)
    continued_evaluations: int = quantity("-", "most trial points of a fit that is only compared", low=1)
    continued_tolerance: float = quantity("-", "relative change at which such a fit stops", low=1e-12, high=1.0)
    most_refitted: int = quantity(
        "-", "rivals, kinds of function or second quantities that are refitted, at most", low=1
    )
    converging_evaluations: int = quantity("-", "most trial points of a refit that is to converge", low=1)
    # decision
    sure: float = quantity("-", "odds from which a model is preferred to another", low=1.0)
    # how sure each effect is
    near_noise: float = quantity("-", "ratio of residual to noise that is near it", low=1.0)
    # functions for what no listed effect explains
    most_of: float = quantity("-", "part of a cost or of a power that counts as most of it", low=0.0, high=1.0)
    function_ridge: float = quantity("-", "ridge on a node, of the mean power of all nodes' directions", low=0.0)
    largest_shift: float = quantity("-", "predicted change of a parameter, in its scales, that is followed", low=0.0)
    function_multiples: tuple[float, ...] = quantity("-", "parts of the linear estimate to start from", low=0.0)
    promising: float = quantity("-", "part of a predicted fall from which a function is refitted", low=0.0)
    least_function: float = quantity("-", "predicted fall from which a kind is refitted", low=0.0)
    pair_rival: float = quantity("-", "predicted fall of two quantities, over that of one", low=1.0)
    function_tolerance: float = quantity("-", "relative change at which its fit stops", low=1e-12)
    node_deviation: float = quantity("-", "prior deviation of a node, in the kind's scale", low=1e-6)
    change_deviation: float = quantity("-", "the same of a change's node, in the function's rms", low=1e-6)
    slowest: float = quantity(
        "Hz", "pulsation of the supply that is looked for at least, and end of what is slow", low=1e-3
    )
    fastest_pulsation: float = quantity("Hz", "fastest pulsation of the supply looked for", low=1e-3)
    period_freedom: float = quantity("-", "relative change of a period that its fit may make", low=0.0, high=0.9)
    # what remains
    remaining_above: float = quantity("-", "ratio of residual to noise from which something remains", low=0.0)
    remaining_far_above: float = quantity("-", "the same from which a motion of its own is suspected", low=0.0)
    remaining_groups: int = quantity("-", "quantile groups of a quantity", low=2)
    remaining_share: float = quantity("-", "explained share from which a residual depends on a quantity", low=0.0)
    # the force that the final model lacks
    force_passes: int = quantity("-", "runs under the force so far, at most", low=0)
    force_settled: float = quantity("-", "fall of what is left, of that without the force, that ends them", low=0.0)
    force_band: float = quantity("-", "probability of the force's confidence band", low=0.01, high=0.999)
    force_highest: float = quantity("-", "largest ratio to its standard deviation up to which it is zero", low=0.0)
    force_kurtosis: float = quantity("-", "kurtosis from which it is impulsive", low=0.0)
    force_reversal: float = quantity("s", "time about a reversal that counts as at it", low=1e-4)
    force_memory: float = quantity("-", "share that only its loop explains from which it has a memory", low=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        described: Any = self.__dataclass_fields__
        name = "function_multiples"
        given: Any = self.function_multiples
        if isinstance(given, str) or not isinstance(given, Iterable):
            raise ShakeError(f"{name}: needs a list of numbers")
        object.__setattr__(self, name, tuple(check(name, v, described[name].metadata, float) for v in given))
