"""What trainers need of a data set of labelled motors, whatever its files look like."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from boltpose.arrays import FloatArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LabelledCloud:
    """Points with the class of each."""

    points: FloatArray
    """Shape (N, 3), mm; frame `prior` for a full scan, `camera` for a view."""
    labels: UInt8Array
    """Shape (N,), `Part` numbers."""


class LabelledMotors(Protocol):
    """Motors with labelled full scans and, maybe, labelled views. Picklable."""

    @property
    def root(self) -> Path:
        """Folder of the data set, for messages."""
        ...

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of all motors, sorted."""
        ...

    @property
    def families(self) -> tuple[str, ...]:
        """Names of all families, sorted."""
        ...

    def family(self, motor: str) -> str:
        """Family of a motor; motors of one family share their construction."""
        ...

    def motors_of(self, family: str) -> tuple[str, ...]:
        """Motors of one family, sorted.

        Raises:
            ValueError: There is no such family.
        """
        ...

    def full_scan(self, motor: str) -> LabelledCloud:
        """Labelled full scan of a motor, frame `prior`."""
        ...

    def view_count(self, motor: str) -> int:
        """Number of views of a motor."""
        ...

    def view(self, motor: str, number: int) -> LabelledCloud:
        """One labelled view, frame `camera`."""
        ...
