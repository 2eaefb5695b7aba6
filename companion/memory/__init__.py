"""What hits have shown of the surroundings: surface patches, merged, planned around, saved and loaded."""
