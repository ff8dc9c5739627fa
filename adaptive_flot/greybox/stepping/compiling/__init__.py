"""Machine code of a function, and its calls.

Map
---
compiled.py     Machine code with the system's C compiler, and its cache.
kept.py         How many of them the cache keeps.
safe_folder.py  Whether a file is this user's own, before it is loaded as code.
fastcall.py     Calls of a compiled function without copies.
"""
