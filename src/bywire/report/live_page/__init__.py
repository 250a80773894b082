"""A bench in a page: the run itself as WebAssembly, parameters to move, curves."""
