"""The flotation cell of Gonzalez & Quintanilla with the froth physics of Quintanilla et al. (2021)."""

from adaptive_flot.processes.flotation.cell import make_model
from adaptive_flot.processes.flotation.cell_file import default_cell, read_cell, save_cell
from adaptive_flot.processes.flotation.parameters import Cell

__all__ = ["Cell", "default_cell", "make_model", "read_cell", "save_cell"]
