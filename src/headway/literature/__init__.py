"""Published studies, run again: one folder each, named after its first author and its year."""
