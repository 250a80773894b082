"""Speed: the same problem by hand and by other simulators."""
