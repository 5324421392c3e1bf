"""From a residual to the effects that a model lacks: candidates, the one loop, verdicts."""
