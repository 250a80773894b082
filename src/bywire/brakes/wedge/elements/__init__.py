"""Elements of this brake alone."""
