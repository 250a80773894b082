"""A motor's winding and its current loop."""
