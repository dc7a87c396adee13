"""Damaged and hostile logs, and what reading them must never do: see `benchmarks.fuzz`."""
