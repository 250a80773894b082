"""Parts of the benchmark that need no brake."""
