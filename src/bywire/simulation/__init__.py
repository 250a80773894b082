"""Time stepping, kernel emission, compilation, and runs, independent of any brake."""
