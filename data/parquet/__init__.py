"""Parquet logs: the pages looked through before anything is unpacked, columns out of them, and the writer."""
