"""Speed of the wedge brake: the same problem by hand and by other simulators."""
