"""What an impact was: when, how fast, against which normal, how hard."""
