"""Stimuli, one per file: signals that drive an experiment, as pure functions of time."""
