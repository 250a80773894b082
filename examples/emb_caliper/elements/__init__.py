"""Physical elements that bywire lacks, one file each."""
