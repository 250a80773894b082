"""Screenshots of pages: how they are taken, stored and compared."""
