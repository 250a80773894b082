"""Templates for ``bywire new``: a brake, its project files and its tests."""
