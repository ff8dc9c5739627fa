"""Pictures and tables of README and docs, drawn anew from runs.

Map
---
readme_figure.py     The README's pictures of runs.
discovery_figure.py  The README's picture of discovery.
readme_table.py      The comparison of closed loops, put into its page.
"""
