"""Faults of a bench: what may fail, when it does, and what that changes in its runs."""
