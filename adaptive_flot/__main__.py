"""`python -m adaptive_flot` is the command `adaptive-flot`."""

from adaptive_flot.cli import main

if __name__ == "__main__":
    main()
