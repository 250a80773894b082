"""Control loops of the brakes, one file each."""
