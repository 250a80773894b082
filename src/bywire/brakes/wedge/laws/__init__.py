"""Control laws of this brake alone."""
