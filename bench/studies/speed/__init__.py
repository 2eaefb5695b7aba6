"""How fast the lockstep loop is, what an interval of it costs in time and calls, how soon a hit is answered."""
