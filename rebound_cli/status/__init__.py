"""The state of a running program for whoever asks on this machine: `rebound status`."""
