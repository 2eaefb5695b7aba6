"""`rebound tune`: from healthy flights to what a detector can see on this vehicle, and the settings to fly with."""
