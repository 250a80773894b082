"""Figures of vehicles alone."""
