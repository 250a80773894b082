"""Parameter sets, one file each."""
