"""Parameter sets with the sources of their values."""
