"""What the user asked for: the campaign and the gains, as frozen values."""
