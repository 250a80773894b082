"""Control laws, one file each. ``bywire check`` finds and tests them."""
