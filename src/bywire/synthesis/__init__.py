"""Design of gains and sizes from requirements and demands."""
