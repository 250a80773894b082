"""Foundations that know no brake: quantities, operations, parameters, signals, model protocol."""
