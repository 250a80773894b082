"""The brake with other motors, one file each."""
