"""The brake at a wheel, one rig per file."""
