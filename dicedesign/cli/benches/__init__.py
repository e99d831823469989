"""One module for each bench, with its command line, and `reporting`, which they share.

Each imports what it runs where it runs it: the command line and the other benches do without."""
