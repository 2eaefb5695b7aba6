"""Whether something was hit; after a hit where the vehicle is, what it must stay off, and the plan to rest."""
