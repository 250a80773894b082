"""Stimuli, one per file: what drives an experiment, as a pure function of time."""
