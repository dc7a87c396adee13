"""The file door, a module a format: from a file's bytes to the wanted signals in SI."""
