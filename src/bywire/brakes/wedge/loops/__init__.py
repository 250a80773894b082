"""Control loops, by the controller that closes them, and what they share."""
