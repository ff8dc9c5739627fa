"""From an export's bytes to signals: one a tag, with times in UTC and values as numbers.

Map
---
export.py   An export: its signals, and what was found out about the file.
raw.py      The cells of a file as they stand; what is unclear about one.
text.py     Text files: encoding and separator.
workbook.py Spreadsheets, Parquet, and tables at hand.
header.py   Where header, units and data stand, and which columns hold the time.
times.py    Times, whatever their form; those of a clock that jumped.
stamps.py   Times: their form.
counted.py  Times that are numbers.
clock.py    Times: their zone, also through the hour that is there twice.
numbers.py  Numbers: decimal comma, thousands, units behind them.
signals.py  Columns (wide) or rows (long) as signals.
"""
