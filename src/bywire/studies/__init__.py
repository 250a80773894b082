"""Studies: one bench for many values of what varies, and what its key figures make of that."""
