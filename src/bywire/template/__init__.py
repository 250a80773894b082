"""The package that ``bywire new`` writes, and what writes it."""
