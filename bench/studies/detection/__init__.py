"""What is reported of hits, and where nothing was hit."""
