"""What is known of the other end: who it is, how fresh its messages are, how fast its streams arrive."""
