"""What the specification of faults states beside what the brakes of this package give."""
