"""One module for each bench, with its command line."""
