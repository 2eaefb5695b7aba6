"""How fast the lockstep loop is, what an interval of it costs, and how many calls it makes."""
