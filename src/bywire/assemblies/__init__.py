"""Complete brakes, rigs and ECUs: wiring of elements, nothing else."""
