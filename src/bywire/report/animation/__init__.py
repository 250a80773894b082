"""Runs as moving pictures: one HTML file that plays them."""
