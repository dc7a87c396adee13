"""What a command leaves behind: the result folder and the files in it."""
