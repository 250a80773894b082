"""Live page of a bench: the run as WebAssembly, parameters with sliders, curves."""
