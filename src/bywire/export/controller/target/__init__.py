"""Tests of an exported ECU on other processors: compilation, emulation and measurement."""
