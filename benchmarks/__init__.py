"""Speed of bywire compared with hand-written C and other simulators."""
