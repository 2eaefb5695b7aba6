"""Recovery laws, one file each, behind one interface and selected by name."""
