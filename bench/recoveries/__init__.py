"""Recovery laws side by side: the same hits, flown through the whole wire."""
