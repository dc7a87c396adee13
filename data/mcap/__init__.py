"""MCAP logs: the walk through untrusted bytes, columns out of them, and the writer."""
