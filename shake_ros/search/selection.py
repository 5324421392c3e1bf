"""What a search has found so far: the fit of the declared model, the steps from it, the final fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from shake_ros.fit.nuisances.estimates import NuisanceEstimates
from shake_ros.search.decision import ForwardStep
from shake_ros.search.problem import ScoredFit
from shake_ros.search.unlisted_functions import FunctionSearch


@dataclass(frozen=True)
class Selection:
    """Fit of the declared model, steps, final fit.

    removed : effects taken out again. functions : what was tried for something that no listed effect explains.
    stopped : whether the search ended before it was done. nuisances : estimates of the recordings' nuisance parameters
    with its models.
    """

    declared: ScoredFit
    steps: tuple[ForwardStep, ...]
    final: ScoredFit
    removed: tuple[str, ...] = ()
    functions: FunctionSearch | None = None
    stopped: bool = False
    nuisances: NuisanceEstimates = field(default_factory=NuisanceEstimates)

    @property
    def models(self) -> tuple[ScoredFit, ...]:
        """Fits of the declared model and after each step; the final one where an effect was taken out since."""
        gone = tuple(f"effects.{effect}." for effect in self.removed)
        along = [step.chosen.result for step in self.steps[:-1]]
        along = (
            [self.final if any(n.startswith(gone) for n in f.fit.free.names) else f for f in along] if gone else along
        )
        return (self.declared, *along, *([self.final] if self.steps else []))

    def on(self, moved: Callable[[ScoredFit], ScoredFit], last: Callable[[ScoredFit], ScoredFit]) -> Selection:
        """The same models on other data: `last` makes the final one, `moved` those before."""
        if not self.steps:
            again = last(self.final)
            return replace(self, declared=again, final=again)
        final, steps = last(self.final), list[ForwardStep]()
        for step in self.steps:
            result = final if step is self.steps[-1] else moved(step.chosen.result)
            chosen = replace(step.chosen, result=result)
            steps.append(replace(step, chosen=chosen, ranking=(chosen, *step.ranking[1:])))
        return replace(self, declared=moved(self.declared), steps=tuple(steps), final=final)

    def with_step(self, step: ForwardStep) -> Selection:
        """One effect more."""
        return replace(self, steps=(*self.steps, step), final=step.chosen.result)
