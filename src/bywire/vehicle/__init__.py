"""Vehicles around any brake: what they share, and what is said of their stops."""
