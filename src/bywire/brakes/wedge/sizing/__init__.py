"""What the sizing studies compute."""
