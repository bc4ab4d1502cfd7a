"""When may a stored record be kept? When nothing that it follows from has changed."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterable
from pathlib import Path

import numpy as np

import boltpose
from boltpose.evaluation.records import Environment
from boltpose.io.source_commit import source_commit

PACKAGE = Path(boltpose.__file__).parent
SOURCES = (
    "*.py",
    "geometry/**/*.py",
    "io/**/*.py",
    "segmentation/**/*.py",
    "prior/**/*.py",
    "registration/**/*.py",
    "evaluation/**/*.py",
)
"""What the numbers follow from; the command line, training and networks' code do not count."""
RENDERING = frozenset(
    {
        "report.py",
        "tables.py",
        "targets.py",
        "summary.py",
        "statistics.py",
        "foreign.py",
        "prior_tables.py",
        "calibration_tables.py",
        "calibration_report.py",
        "trust_report.py",
    }
)
"""Modules of `evaluation` that only read records."""
OTHER_EVALUATIONS = (
    "study_",
    "table1",
    "peers",
    "hard_",
    "bolt_state",
    "variants",
    "several_views",
    "uncertainty",
)
"""Names of modules of other evaluations begin with one of these."""


def fingerprint(data: Path, models_dir: Path, request: Iterable[str]) -> str:
    """Hash the package's source, the networks, the data and what was asked for.

    The source and the networks count by content, the data by names and sizes: it is frozen.

    Args:
        data: Folder of reman18.
        models_dir: Folder of the leave-out networks.
        request: What else the records depend on, as texts.

    Returns:
        16 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for pattern in SOURCES:
        for path in sorted(PACKAGE.glob(pattern)):
            relative = path.relative_to(PACKAGE)
            is_other = relative.name in RENDERING or relative.name.startswith(OTHER_EVALUATIONS)
            if relative.parts[0] == "evaluation" and is_other:
                continue
            digest.update(f"{relative.as_posix()}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    for path in sorted(path for path in models_dir.rglob("*") if path.is_file()):
        digest.update(f"{path.relative_to(models_dir).as_posix()}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    for path in sorted(path for path in data.glob("motor_*/**/*") if path.is_file()):
        digest.update(f"{path.relative_to(data).as_posix()} {path.stat().st_size}\0".encode())
    for text in request:
        digest.update(f"{text}\0".encode())
    return digest.hexdigest()[:16]


def describe_environment() -> Environment:
    """Say where the numbers come from; the commit is `unknown` outside a git checkout."""
    return Environment(
        version=boltpose.__version__,
        commit=source_commit() or "unknown",
        python=platform.python_version(),
        numpy=np.__version__,
        machine=f"{platform.system()} {platform.machine()}",
        cores=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1,
    )
