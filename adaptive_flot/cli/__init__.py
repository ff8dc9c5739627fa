"""The command `adaptive-flot`.

===================== =================================================================
`entry`               the entry point: errors become one line and an exit code
`commands`            the list of commands, and the options before a command
`run` ... `scenarios` one file a command: its options, and what it calls
`options`             options that several commands share
`live/`               commands of the live link and its test plant
`import_preview`      what `import` shows and asks before it writes
===================== =================================================================

Heavy libraries are imported by the command that needs them, so that help is quick.
"""

from adaptive_flot.cli.commands import app
from adaptive_flot.cli.entry import main

__all__ = ["app", "main"]
