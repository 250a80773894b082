"""Plants and their simplified models, one file each."""
