"""The page of `sweep`: which contender a study of many runs favours, how surely, and what failed.

Map
---
page.py     The page: answer, matrix, distributions, and the tables of `compare` for each scenario.
answer.py   The answer in words and numbers.
seeds.py    Seeds worth a look: those that failed, and those that did worst.
"""
