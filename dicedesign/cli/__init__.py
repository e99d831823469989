"""One module for each subcommand of the command line; each imports only what it needs."""
