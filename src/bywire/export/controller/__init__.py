"""Readable C99 of a model's ECU, translated from the Python of its laws."""
