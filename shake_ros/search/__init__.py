"""From a residual to the effects that a model lacks: candidates, the one loop, functions on no list, verdicts."""
