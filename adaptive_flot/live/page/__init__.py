"""The page of a running link for the control room. It shows what the link tells, and hands on what persons ask for.

Map
---
attempts.py     Failed log-ins by address: each further attempt waits longer.
access.py       Tokens, sessions, and what a request must have before it counts.
picture.py      What the page shows of a cycle: plain numbers and words, nothing that a script could run.
beside.py       The card of discovery, and what runs in shadow.
axes.py         The panels over time: which lines they have, and the numbers of a cycle for them.
hub.py          The last hour, and the browsers that listen; one that is slow is dropped.
application.py  What is served: the page, its stream, and the actions.
stream.py       Server-sent events to one browser.
connections.py  Bounds on connections: how many, and how long each may take to ask.
server.py       The server in a thread of its own, which the loop of the link never waits for.
assets/         The page itself; charts are those of `adaptive_flot/charts`.

The link calls `PageServer.show` after each cycle, which puts the cycle into a mailbox. The thread of the page takes it
from there. A person's request goes into the `Inbox`, and the next cycle takes it from there.
"""
