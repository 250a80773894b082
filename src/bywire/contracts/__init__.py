"""Contracts of elements, laws, parameter sets and models, which ``bywire check`` checks."""
