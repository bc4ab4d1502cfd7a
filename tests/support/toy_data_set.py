"""A data set of toy motors, in memory: what trainers see of reman18 and of a user's scans."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from boltpose.datasets.labelled_motors import LabelledCloud
from tests.support.toy_motor import toy_motor


@dataclass(frozen=True)
class ToyDataSet:
    """Motors `toy_0`, `toy_1`, ... of families `a`, `b` in turn; no views. Picklable."""

    count: int = 3
    density: float = 0.05
    root: Path = Path("toys")

    @property
    def motors(self) -> tuple[str, ...]:
        return tuple(f"toy_{number}" for number in range(self.count))

    @property
    def families(self) -> tuple[str, ...]:
        return tuple(sorted({self.family(motor) for motor in self.motors}))

    def family(self, motor: str) -> str:
        return "ab"[int(motor[4:]) % 2]

    def motors_of(self, family: str) -> tuple[str, ...]:
        return tuple(motor for motor in self.motors if self.family(motor) == family)

    def full_scan(self, motor: str) -> LabelledCloud:
        toy = toy_motor(seed=int(motor[4:]), density=self.density)
        return LabelledCloud(points=toy.points, labels=toy.labels)

    def view_count(self, motor: str) -> int:
        return 0

    def view(self, motor: str, number: int) -> LabelledCloud:
        raise ValueError(f"{motor} has no view {number}")
