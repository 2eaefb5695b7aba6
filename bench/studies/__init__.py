"""The studies, one file each: which cases, which columns, which bars."""
