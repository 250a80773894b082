"""Stated figures of faults beside those that the brakes of this package compute."""
