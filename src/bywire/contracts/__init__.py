"""Contracts of every element, law, parameter set and model, checked by ``bywire check``."""
