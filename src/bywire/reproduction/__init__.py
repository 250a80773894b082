"""Reproductions of published sources: statements against our results."""
