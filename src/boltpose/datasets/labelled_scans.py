"""A user's own labelled scans: a folder of PLY or PCD files as `boltpose label` writes them."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from boltpose.datasets.labelled_motors import LabelledCloud
from boltpose.errors import InputFileError
from boltpose.io.label_files import LABEL_SUFFIXES, read_labelled_scan
from boltpose.io.units import Unit, as_unit
from boltpose.schema import Part
from boltpose.segmentation.thinning import thin_scan

MIN_POINTS = 5000
"""As for a prior: fewer show no bolt."""

VIEWS_ENDING = "_views"

_WANTED = "labelled full scans NAME.ply or NAME.pcd, or FAMILY/NAME.ply, with views in NAME_views/"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Motor:
    """The files of one motor."""

    family: str
    full_scan: Path
    views: tuple[Path, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledScans:
    """The motors of a folder of labelled scans.

    A file `NAME.ply` (or `.pcd`) is the full scan of the motor NAME. In a sub-folder FAMILY it is
    of that family; beside the folder's other files it is a family of its own. Labelled views of it
    are the files of `NAME_views` beside it, in the order of their names. Other files and names
    that start with a dot are passed over. No scan is read before it is asked for.

    Raises:
        InputFileError: It is no folder, there is no scan in it, two scans have the same name, or
            views have no full scan.
    """

    root: Path
    unit: Unit = Unit.MM
    """Unit of length in all files."""
    _motors: dict[str, _Motor] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", as_unit(self.unit))
        object.__setattr__(self, "_motors", _find_motors(self.root))

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of all motors, sorted."""
        return tuple(sorted(self._motors))

    @property
    def families(self) -> tuple[str, ...]:
        """Names of all families, sorted."""
        return tuple(sorted({motor.family for motor in self._motors.values()}))

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that change with the content of any file: for caches."""
        digest = hashlib.sha256(self.unit.encode())
        for name in self.motors:
            motor = self._motors[name]
            for path in (motor.full_scan, *motor.views):
                digest.update(f"\0{name}\0{motor.family}\0".encode())
                with path.open("rb") as stream:
                    digest.update(hashlib.file_digest(stream, "sha256").digest())
        return digest.hexdigest()[:12]

    def family(self, motor: str) -> str:
        """Family of a motor; motors of one family share their construction."""
        return self._motors[motor].family

    def motors_of(self, family: str) -> tuple[str, ...]:
        """Motors of one family, sorted.

        Raises:
            ValueError: There is no such family.
        """
        found = tuple(motor for motor in self.motors if self.family(motor) == family)
        if not found:
            raise ValueError(f"family must be one of {self.families}, got '{family}'")
        return found

    def full_scan(self, motor: str) -> LabelledCloud:
        """Read the labelled full scan of a motor, frame `prior`.

        Background (a table, a clamp) and strays are left out, and what is denser than the networks
        know is thinned, as when a prior is built.

        Raises:
            InputFileError: The file cannot be used, or too little of it is motor.
            UnitError: Its size does not fit the unit.
        """
        path = self._motors[motor].full_scan
        scan = read_labelled_scan(path, unit=self.unit)
        assert scan.labels is not None
        on_motor = scan.labels != Part.BACKGROUND
        points, labels = scan.points[on_motor], scan.labels[on_motor]
        if len(points) < MIN_POINTS:
            found = f"{len(points)} of {len(scan)} points that are not background"
            raise InputFileError(path, found, f"at least {MIN_POINTS}")
        keep = thin_scan(points)
        return LabelledCloud(points=points[keep], labels=labels[keep])

    def view_count(self, motor: str) -> int:
        """Number of views of a motor."""
        return len(self._motors[motor].views)

    def view(self, motor: str, number: int) -> LabelledCloud:
        """Read one labelled view, frame `camera`; 0 is background, any other label is motor.

        Raises:
            InputFileError: The file cannot be used.
            UnitError: Its size does not fit the unit.
        """
        scan = read_labelled_scan(self._motors[motor].views[number], unit=self.unit)
        assert scan.labels is not None
        return LabelledCloud(points=scan.points, labels=scan.labels)


def _find_motors(root: Path) -> dict[str, _Motor]:
    """Look for scans in a folder and its sub-folders."""
    if not root.is_dir():
        raise InputFileError(root, "a file" if root.exists() else "no such folder", _WANTED)
    folders = [path for path in _visible(root) if path.is_dir()]
    scans = [(path, path.stem) for path in _scans_in(root)]
    for folder in folders:
        if not folder.name.endswith(VIEWS_ENDING):
            scans += [(path, folder.name) for path in _scans_in(folder)]
            folders_within = [path for path in _visible(folder) if path.is_dir()]
            folders = [*folders, *folders_within]
    if not scans:
        raise InputFileError(root, _describe(root), _WANTED)
    motors: dict[str, _Motor] = {}
    for path, family in scans:
        other = motors.get(path.stem)
        if other is not None:
            found = f"a second scan named '{path.stem}' beside {other.full_scan}"
            raise InputFileError(path, found, "another name for every motor")
        views = path.with_name(path.stem + VIEWS_ENDING)
        motors[path.stem] = _Motor(
            family=family,
            full_scan=path,
            views=tuple(_scans_in(views)) if views.is_dir() else (),
        )
    for folder in folders:
        if folder.name.endswith(VIEWS_ENDING):
            name = folder.name.removesuffix(VIEWS_ENDING)
            if name not in motors or motors[name].full_scan.parent != folder.parent:
                raise InputFileError(folder, "views without a full scan", f"{name}.ply beside them")
    return motors


def _visible(folder: Path) -> list[Path]:
    """What a folder holds, sorted, without hidden names."""
    return sorted(path for path in folder.iterdir() if not path.name.startswith("."))


def _scans_in(folder: Path) -> list[Path]:
    """Files of a folder that may be labelled scans, sorted."""
    return [
        path
        for path in _visible(folder)
        if path.suffix.lower() in LABEL_SUFFIXES and path.is_file()
    ]


def _describe(root: Path) -> str:
    """Say what a folder without scans holds."""
    endings = Counter(
        path.suffix.lower() or "no ending" for path in _visible(root) if path.is_file()
    )
    folders = sum(path.is_dir() for path in _visible(root))
    named = [f"{count} x {ending}" for ending, count in sorted(endings.items())[:5]]
    named += [f"{folders} folders"] if folders else []
    return f"no scan but {', '.join(named)}" if named else "an empty folder"
