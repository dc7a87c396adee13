"""Logs that are tables of typed columns: what Parquet and MATLAB files have in common."""
