"""Exports of a bench: an ECU's C code, functional mock-up units, WebAssembly."""
