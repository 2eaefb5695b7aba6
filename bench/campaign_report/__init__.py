"""`bench campaign`: random missions, and hits with both laws, judged by what must be shown; bench/notes/results.md."""
