"""Brake-independent foundations: quantities, operations, parameters, signals, model protocol."""
