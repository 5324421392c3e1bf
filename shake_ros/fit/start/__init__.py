"""Where a fit begins: checks of the data, what they show without a model, and ways into a narrow valley."""
