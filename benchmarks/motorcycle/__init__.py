"""Speed of the motorcycle brake, compared with hand-written C and other simulators."""
