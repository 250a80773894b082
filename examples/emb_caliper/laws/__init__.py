"""Control laws that bywire lacks, one file each."""
