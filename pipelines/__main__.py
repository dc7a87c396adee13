"""`python -m pipelines`: the command line without an installed command."""

from pipelines.cli import main

if __name__ == "__main__":
    main()
