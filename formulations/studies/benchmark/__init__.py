"""The library beside its peers: processor time per start and per success, in one run."""
