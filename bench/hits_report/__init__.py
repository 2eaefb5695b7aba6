"""What the hits through the whole wire show: build/hits.md."""
