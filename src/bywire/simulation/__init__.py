"""The engine: time stepping, kernel emission, compilation, runs. It knows no brake."""
