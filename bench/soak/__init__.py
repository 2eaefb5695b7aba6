"""The guard as a service for hours, by the clock."""
