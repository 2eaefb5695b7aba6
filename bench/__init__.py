"""The laboratory: studies and judges, run from a checkout. What flies needs none of it."""
