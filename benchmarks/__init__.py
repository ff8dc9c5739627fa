"""What is fast, measured: `make bench`. Nothing in the package imports this."""
