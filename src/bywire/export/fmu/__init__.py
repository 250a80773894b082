"""Functional mock-up units: a bench's brake, its plant, or its ECU, for other tools."""
