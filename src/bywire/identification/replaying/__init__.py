"""Measured demands through the model: replay, its judgment, and parameters that drift."""
