"""Studies: a grid of runs on several processes or machines, kept on disk as it grows."""
