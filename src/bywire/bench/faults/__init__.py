"""Faults of a bench: failure modes, their times, and their effects in runs."""
