"""From a case to its row: the judges, by the simulator's truth, and what a table is made of."""
