"""Random missions in random rooms: drawn from a seed, flown through the whole wire, judged by what really happened."""
