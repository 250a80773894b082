"""Rigs of the drive train, and a quarter car."""
