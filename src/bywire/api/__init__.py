"""The use cases, one file each: what commands and notebooks call, with typed results."""
