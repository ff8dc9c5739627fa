"""Commands of the live link.

Map
---
link.py          `live`: run a link.
plant.py         `serve-plant`: a test plant to connect to.
certificates.py  `certificates`: keys for both ends.
export.py        `export`: what a link has stored, as a record.
"""
