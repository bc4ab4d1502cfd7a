"""`boltpose.toml`: the settings of one robot cell, so that its commands need few options."""

from boltpose.cell.file import CellFile, find_cell, read_cell
from boltpose.cell.locate_section import LocateSection

__all__ = ["CellFile", "LocateSection", "find_cell", "read_cell"]
