"""Runs commands in this process, with files like a user's and no networks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import boltpose.segmentation.models
from boltpose.cli.app import main
from boltpose.prior.file import write_prior
from boltpose.schema import LocateResult, Prior, Scan
from tests.support import results


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Run = Callable[..., Outcome]
LOCATE = import_module("boltpose.locate")
"""The module: `boltpose.locate` is the function."""


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run `boltpose` with arguments."""

    def call(*arguments: str | Path) -> Outcome:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(int(code), captured.out, captured.err)

    return call


@dataclass(frozen=True)
class Cell:
    """The files of a robot cell."""

    folder: Path
    scan: Path
    prior: Path
    hand_eye: Path
    known: Prior


def write_ply(path: Path, points: np.ndarray) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    body = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points)
    path.write_text(header + body)


def write_matrix(path: Path, matrix: np.ndarray) -> None:
    rows = "".join(f"    - {[float(value) for value in row]}\n" for row in matrix)
    path.write_text(f"FloatMatrix:\n  Data:\n{rows}")


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    """A scan, a prior and a hand-eye file in a fresh folder."""
    known = results.cube_prior()
    cell = Cell(
        folder=tmp_path,
        scan=tmp_path / "scan.ply",
        prior=tmp_path / "cube.prior.npz",
        hand_eye=tmp_path / "hand_eye.yaml",
        known=known,
    )
    write_ply(cell.scan, results.cube_scan(known).points)
    write_prior(cell.prior, known)
    write_matrix(cell.hand_eye, results.BASE_FROM_CAMERA.matrix)
    return cell


class _NoNetworks:
    parts = None
    scene = None
    hashes: dict[str, str] = {}  # noqa: RUF012  a stand-in, never changed


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[..., LocateResult]], None]:
    """Let `locate` answer with what a function of scan, prior and hand-eye returns."""

    def use(make: Callable[..., LocateResult]) -> None:
        def locate(scan: Scan, prior: Prior, base_from_camera, predictor, config, **rest):
            del predictor, config
            rest["on_stage"]("segmentation", 0.25)
            rest["on_stage"]("registration", 0.5)
            return make(scan, prior, base_from_camera)

        monkeypatch.setattr(LOCATE, "locate", locate)
        monkeypatch.setattr(
            boltpose.segmentation.models, "load_models", lambda folder=None: _NoNetworks()
        )

    return use


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("boltpose.picture.paint.SUPERSAMPLING", 1)
