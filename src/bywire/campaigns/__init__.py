"""Fault campaigns: every failure of a brake in a maneuver, its effect, and its detection."""
