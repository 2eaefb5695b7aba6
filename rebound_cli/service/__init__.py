"""`rebound service`: the guard, or a mission, as a service of systemd."""
