"""What a flight leaves: its folder, its log as arrays, the summary, the end in words."""
