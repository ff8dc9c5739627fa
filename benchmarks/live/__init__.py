"""Is the live link safe, and how fast is it? Run `python -m benchmarks.live`.

Map
---
faults.py    What fails when: instruments, the network, the plant's clock, writes, processes.
audit.py     An auditor that knows the faults, and judges every write that the plant took.
lockstep.py  Many cycles of link and plant in one process, with storage.
page.py      The page in a real Chromium: from a change in the plant's server to its paint.
soak.py      Simulated hours with the page open: memory and times of cycles.
network.py   Processes of their own over OPC UA: killed, stopped and started again.
"""
