"""After a hit: where the vehicle is, what it must stay off, and the plan that brings it to rest."""
