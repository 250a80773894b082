"""What the source states, beside what we compute."""
