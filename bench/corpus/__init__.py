"""A golden corpus: what vehicles sent, with the truth beside it, to compare two versions of the code on."""
