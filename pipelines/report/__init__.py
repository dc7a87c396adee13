"""Pictures, tables and the page: they draw result values and compute nothing."""
