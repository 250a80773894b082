"""Variants of the brake, one file each."""
