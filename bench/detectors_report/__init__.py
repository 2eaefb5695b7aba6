"""Tables and pictures of the detectors' bench."""
