"""Choosing gains and sizes: requirements and demands in, designs and what they give out."""
