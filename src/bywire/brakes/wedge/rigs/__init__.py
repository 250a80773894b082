"""Rigs of the drive train, and a car's corner."""
