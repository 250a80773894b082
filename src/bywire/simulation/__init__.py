"""Time stepping, generation and compilation of kernels, and runs, independent of any brake."""
