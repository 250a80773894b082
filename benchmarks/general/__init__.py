"""Parts of the benchmark that do not need a brake."""
