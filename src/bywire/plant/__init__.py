"""Physical elements, one per file, with only parameters, states and equations."""
