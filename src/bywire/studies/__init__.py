"""Studies: one bench with many values of its parameters, and the effect on its key figures."""
