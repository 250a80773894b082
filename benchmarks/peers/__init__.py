"""Comparison partners of the speed benchmark: one file per tool that a user would pick instead."""
