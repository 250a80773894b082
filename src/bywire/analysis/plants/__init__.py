"""Plants of the brakes and their simplified models, one file each."""
