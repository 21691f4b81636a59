"""The commands of the command line, one per file; heavy imports only where they are used."""
