"""Smaller linear models, with the error that they make."""
