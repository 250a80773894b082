"""Control laws of the brake, one file each."""
