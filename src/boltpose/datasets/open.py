"""One door to labelled motors, whatever layout their folder has."""

from __future__ import annotations

from pathlib import Path

from boltpose.datasets.labelled_scans import LabelledScans
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import InputFileError
from boltpose.io.units import Unit, as_unit


def open_data_set(root: Path, *, unit: str = Unit.MM) -> Reman18 | LabelledScans:
    """Open a folder of labelled motors.

    Args:
        root: Of the layout of reman18 (so are data sets of `boltpose synth`), or with a user's
            own scans, see `LabelledScans`.
        unit: Unit of length in a user's scans; reman18 is in mm.

    Raises:
        InputFileError: The folder is missing or has neither layout; the text says what it has.
        ConfigError: There is no such unit.
    """
    if any(root.glob("motor_*/prior.ply")):
        return Reman18(root=root)
    try:
        return LabelledScans(root=root, unit=as_unit(unit))
    except InputFileError as error:
        if error.path != root:
            raise
        wanted = f"{error.wanted}; or motor_*/prior.ply as in reman18"
        raise InputFileError(root, error.found, wanted) from None


def cache_folder(data: Reman18 | LabelledScans, base: Path) -> Path:
    """Where features of a data set may be kept.

    Features are found again by the names of motors. Other data sets have motors of the same
    names, and a user's folder changes under them (that is what correcting labels is), so the place
    depends on what the files hold.

    Args:
        data: The motors.
        base: Folder for the caches of all data sets.
    """
    return base / f"{data.root.resolve().name}-{data.fingerprint}"
