"""A model of recordings: parameters, nuisances, prediction, likelihood."""
