"""What a person writes, as validated models, and the missions that ship with the program."""
