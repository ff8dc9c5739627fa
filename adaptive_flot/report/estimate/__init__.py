"""The report of `estimate`: a measured record replayed through estimators (`page.py`)."""
