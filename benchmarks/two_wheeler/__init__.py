"""Speed of the two-wheeler in a controlled stop, compared with hand-written C."""
