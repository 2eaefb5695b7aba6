"""The faults and attacks, one file a kind."""
