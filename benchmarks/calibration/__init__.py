"""Whether identification keeps its promises: one file a promise, each with its rows."""
