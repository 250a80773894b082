"""Speed of the master cylinder: the same problem by hand and by other simulators."""
