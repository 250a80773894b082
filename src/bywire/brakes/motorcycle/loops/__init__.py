"""Control loops, one file each, and what they share."""
