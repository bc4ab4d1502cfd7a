"""What is evaluated, as one value, so that tests can put something simple in its place."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from boltpose.evaluation.records import CallTime, StageTime
from boltpose.geometry.transforms import Transform
from boltpose.schema import LocateResult, Prior, Scan

Models = TypeVar("Models")
OnStage = Callable[[str, float], None]
"""Called with a stage's name and its wall time in seconds when it is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pipeline(Generic[Models]):
    """The functions a user calls, from files to poses."""

    load_models: Callable[[Path], Models]
    read_scan: Callable[[Path], Scan]
    read_hand_eye: Callable[[Path], Transform]
    """Returns `base_from_camera`."""
    build_prior: Callable[[Scan, Models, str, OnStage], Prior]
    """Scan in frame `prior`, networks, name, stage callback."""
    prepare: Callable[[Prior], Any]
    """Compute once what `locate` needs of a prior; it takes the prior or this."""
    locate: Callable[[Scan, Any, Transform, Models, OnStage], LocateResult]
    """Scan in frame `camera`, prior, `base_from_camera`, networks, stage callback."""


class CallClock:
    """Times one call, wall and process CPU; hand `on_stage` to it for its stages."""

    def __init__(self) -> None:
        self._stages: list[StageTime] = []
        self._wall = time.perf_counter()
        self._cpu = time.process_time()
        self._stage_cpu = self._cpu

    def on_stage(self, name: str, seconds: float) -> None:
        """Note a stage; its CPU time is what the process used since the one before."""
        now = time.process_time()
        self._stages.append(StageTime(name=name, wall_s=seconds, cpu_s=now - self._stage_cpu))
        self._stage_cpu = now

    def stop(self) -> CallTime:
        """Return the time since the clock was made."""
        return CallTime(
            wall_s=time.perf_counter() - self._wall,
            cpu_s=time.process_time() - self._cpu,
            stages=tuple(self._stages),
        )
