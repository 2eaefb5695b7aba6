"""What is flown: worlds, vehicles, hits and missions, named or drawn from a seed."""
