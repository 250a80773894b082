"""Test rigs of the drive train."""
