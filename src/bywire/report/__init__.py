"""Figures, tables and self-contained HTML reports; the only home of matplotlib."""
