"""What each special rule of the companion is worth: the same flights with and without it."""
