"""The obstacle map: surface patches from hits, merged, planned around, saved and loaded."""
