"""Linear models by hand."""
