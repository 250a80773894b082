"""Generated input for every road into bywire, and what must hold of it: see ``__main__``."""
