"""CSV logs in the dialects that rigs write."""
