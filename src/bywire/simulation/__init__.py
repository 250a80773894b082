"""The engine: time stepping, kernel emission, compilation, runs. It is independent of any brake."""
