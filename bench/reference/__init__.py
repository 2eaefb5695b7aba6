"""`bench docs`: the pages below docs/reference/, made from models, arguments, state tables and docstrings."""
