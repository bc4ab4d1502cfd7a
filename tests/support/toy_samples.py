"""Samples that cost nothing, made by functions that worker processes can import."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

from boltpose.synthesis.seeds import Purpose, generator
from boltpose.synthesis.settings import DataSetSettings, Kind
from boltpose.synthesis.write import Sample, SampleFile, sample_name

SETTINGS = DataSetSettings(kind=Kind.MOTORS, seed=3, families=("a", "b"))


def make_toy(settings: DataSetSettings, number: int) -> Sample:
    """A sample of random bytes that follow from the seed alone."""
    noise = generator(settings.seed, number, Purpose.SPEC).bytes(2000)
    return Sample(
        name=sample_name(number),
        files=(
            SampleFile(name="prior.ply", data=noise),
            SampleFile(name="depth/000000.png", data=settings.family_of(number).encode()),
        ),
    )


def make_toy_or_die(settings: DataSetSettings, number: int) -> Sample:
    """As `make_toy`, but number 2 takes its process with it."""
    if number == 2:
        os._exit(1)
    return make_toy(settings, number)


def make_toy_or_stop(settings: DataSetSettings, number: int) -> Sample:
    """As `make_toy`, but at number 2 the user presses Ctrl-C."""
    if number == 2:
        raise KeyboardInterrupt
    return make_toy(settings, number)


def make_slow_toy(folder: Path, settings: DataSetSettings, number: int) -> Sample:
    """As `make_toy`, in no hurry, and leaving word of each attempt and of the node it was on."""
    import ray

    node = ray.get_runtime_context().get_node_id()
    (folder / f"{number}-{node}-{os.getpid()}-{time.time_ns()}").touch()
    time.sleep(2)
    sample = make_toy(settings, number)
    return replace(sample, seconds=((node, 2.0),))


def make_sleepy_toy(settings: DataSetSettings, number: int) -> Sample:
    """As `make_toy`, but all after the first take longer than any test waits."""
    if number > 0:
        time.sleep(100)
    return make_toy(settings, number)
