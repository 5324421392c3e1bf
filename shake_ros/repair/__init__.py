"""The whole repair of a model: declared fit, search, what remains; and the rivals that it leaves."""
