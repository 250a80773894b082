"""Figures of this brake alone."""
