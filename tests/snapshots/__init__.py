"""What users see of the whole product, kept as text and compared."""
