"""What the sources state, beside what this model computes."""
