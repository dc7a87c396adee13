"""Speed and accuracy beside peers, as commands: `python -m benchmarks.NAME`."""
