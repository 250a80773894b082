"""Foundations that know no brake: quantities, operations, parameters, signals, the model protocol."""
