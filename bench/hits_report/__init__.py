"""What the hits through the whole wire show: bench/notes/hits.md."""
