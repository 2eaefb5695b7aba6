"""After a hit: where the vehicle is, and the way to rest."""
