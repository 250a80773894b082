"""What the sizing studies reckon with."""
