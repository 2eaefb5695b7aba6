"""What runs beside a flight in real time: the loop, the terminal, the status, interrupts."""
