"""The virtual rig at work: its bench, its protocols, and the logs they leave."""
