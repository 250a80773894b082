"""Use cases, one file each: the functions behind commands and notebooks, with typed results."""
