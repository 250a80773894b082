"""Parameter sets with the source of every value."""
