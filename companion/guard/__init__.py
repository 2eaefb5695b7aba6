"""Protection for flights that something else commands: watch, take over at a hit, recover, give back."""
