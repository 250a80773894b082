"""Procedures: sequences of stops with prescribed conditions and limits."""
