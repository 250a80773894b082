"""Control laws that bywire does not include, one file each."""
