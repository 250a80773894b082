"""Frequency responses of nonlinear loops."""
