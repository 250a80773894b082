"""Peers in the speed benchmark, one file per tool that users would choose instead."""
