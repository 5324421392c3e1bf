"""A model of recordings: parameters, nuisances, simulation and prediction, likelihood, intervals."""
