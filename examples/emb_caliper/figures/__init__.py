"""Kinds of figures that bywire lacks, one file each."""
