"""The physics of a table: oil, laws, effects, and the plant that they make. EQUATIONS.md lists every equation."""
