"""What ``bywire new`` writes: a brake, its project's files, its tests, under other names."""
