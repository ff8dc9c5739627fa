"""Discovery on records of real processes that nobody here simulated: `python -m benchmarks.real_records [FOLDER]`.

Map
---
air_handling_unit.py   A unit with imposed faults: one clean day as reference, fourteen others; a model of ten lines.
electric_drives.py     Five records of two drives whose counter does not see the sign of the speed.
heat_exchanger.py      A steam heat exchanger whose gain falls with the flow; judged by running on.
lamp.py                A lamp over a plate: a negative example.
asked.py               The figures that were asked for, with targets and what was measured.
folder.py              Where the records are.
measured.py            Single measured records and the shared examples of the cell: `make bench-measured`.
mining_plant.py        An industrial iron-ore flotation plant.
unchanged.py           False alarms: two records of a plant that nobody changed.
__main__.py            Every verdict beside the truth; the cascaded tanks of the package too.
"""
