"""What a run tells while it goes: one JSON line per step, and the same for TensorBoard."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from torch.utils.tensorboard.writer import SummaryWriter

LOG_FILE = "log.jsonl"
TENSORBOARD_FOLDER = "tensorboard"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRecord:
    """One step of training."""

    step: int
    """From 0."""
    loss: float
    rate: float
    """Learning rate of the step."""


class RunLog:
    """Appends to the log of a run folder; a resumed run goes on where its checkpoint was."""

    def __init__(self, folder: Path, start: int = 0) -> None:
        """Open the log.

        Args:
            folder: The run folder; it is made.
            start: First step that will be written: lines from there on, written after the
                checkpoint, are dropped.
        """
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / LOG_FILE
        kept = [record for record in read_log(folder) if record.step < start]
        self._stream = path.open("w", encoding="utf-8")
        for record in kept:
            self._write(record)
        self._board = SummaryWriter(
            str(folder / TENSORBOARD_FOLDER), purge_step=start if start else None
        )

    def add(self, record: StepRecord) -> None:
        """Write one step."""
        self._write(record)
        self._board.add_scalar("loss", record.loss, record.step)
        self._board.add_scalar("rate", record.rate, record.step)

    def _write(self, record: StepRecord) -> None:
        line = {"step": record.step, "loss": record.loss, "rate": record.rate}
        self._stream.write(json.dumps(line) + "\n")

    def flush(self) -> None:
        """Bring everything to disk, before the checkpoint that counts on it."""
        self._stream.flush()
        self._board.flush()

    def close(self) -> None:
        """Finish; nothing may be added afterwards."""
        self._stream.close()
        self._board.close()


def read_log(folder: Path) -> tuple[StepRecord, ...]:
    """The steps of a run so far; none if there is no log. A line cut short by a kill is dropped."""
    path = folder / LOG_FILE
    if not path.exists():
        return ()
    records: list[StepRecord] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found = json.loads(line)
        except json.JSONDecodeError:
            break
        records.append(StepRecord(step=found["step"], loss=found["loss"], rate=found["rate"]))
    return tuple(records)
