"""Physical elements, one per file: parameters, states and equations, nothing else."""
