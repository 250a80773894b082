"""Life of a brake: small changes by every stop, projected over thousands of stops."""
