"""One module for each bench, with its command line, and `reporting`, which they share."""
