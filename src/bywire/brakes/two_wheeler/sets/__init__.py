"""Parameter sets, one file per source."""
