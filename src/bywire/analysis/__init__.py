"""Linear models, frequency responses, and margins of loops."""
