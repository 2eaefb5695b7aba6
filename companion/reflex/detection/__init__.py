"""Whether something was hit, what kind of hit, and what it did."""
