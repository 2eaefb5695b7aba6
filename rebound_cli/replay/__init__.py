"""`rebound replay`: the same detector over a recorded flight, and our own flights decided again to the bit."""
