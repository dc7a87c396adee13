"""How independent work is spread: one verb, map."""
