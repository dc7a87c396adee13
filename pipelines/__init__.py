"""The questions we ask.

Each pipeline reads files, calls the rooms below, and writes files. Pipelines meet through result files
only; the command line knows them all. Settings, processes and argument parsing live here and nowhere else.
"""
