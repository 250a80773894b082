"""Sign-off: requirements with their evidence, and the verdict on each of them."""
