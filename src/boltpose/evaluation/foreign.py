"""How the method behaves on scans that no one here made.

Debian's `opencv-doc` ships the example data of OpenCV's surface matching: a complete model
(`parasaurolophus`) and two cluttered views of a laser scanner that hold it. The object is no
motor and has no bolts: registration and verdict are judged, on real sensor data.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from scipy.spatial import KDTree

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.decoys import mirror_scan
from boltpose.evaluation.negatives import Expectation
from boltpose.evaluation.object_search import SearchResult, prior_of_object, search_object
from boltpose.evaluation.pipeline import CallClock
from boltpose.evaluation.tables import markdown_table
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.relabel import relabel
from boltpose.registration.scene import Standing, build_scene, judge_surface
from boltpose.schema import Scan, Status, Verdict

FORMAT = "boltpose.foreign/1"
MODEL = "parasaurolophus_low_normals2.ply"
SCENES = ("rs1_normals.ply", "rs22_proc2.ply")
SOURCE = (
    "Debian package `opencv-doc` 4.6.0+dfsg-12, `usr/share/doc/opencv-doc/examples/"
    "surface_matching/data/` (`apt-get download opencv-doc`, `dpkg -x`); OpenCV's licence there: "
    "Apache-2.0 and BSD-3-Clause. The files are not copied here"
)

SAME_POSE_MM = 5.0
"""Two poses that put no point of the object further apart than this are the same."""
NEIGHBOUR_MM = 15.0
"""Up to this they are two answers about the same placement, one of them coarser."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignRecord:
    """One object looked for everywhere in one scan."""

    name: str
    expectation: Expectation
    places: int
    """Where it was looked for."""
    accepted: int
    """Places whose verdict was ok."""
    votes: tuple[int, ...]
    """Places per distinct accepted pose."""
    reference_gap_mm: float | None
    """Largest distance between a point of the object at the first accepted pose and at the
    reference pose; None without either."""
    reference_gap_rad: float | None
    surface_mm: float | None
    """Median distance of the object's visible surface from the scan at the first accepted pose."""
    reference_surface_mm: float | None
    """The same at the reference pose: which of the two fits the scan better."""
    failed: Mapping[str, int]
    """Failed checks of all refused places."""
    right_but_refused: int
    """Refused places whose candidate pose is in the reference's neighbourhood."""
    right_failed: Mapping[str, int]
    """The checks that refused them."""
    best_coverage: float | None
    """Share of the object's surface in free view that was measured, at the first accepted pose."""
    cpu_s: float

    @property
    def is_as_wanted(self) -> bool:
        """Refused everywhere; where the object is, one pose is allowed: the reference's.

        The reference is another program's answer, not the truth: a pose in its neighbourhood
        that lies closer to the scan is right, too.
        """
        if not self.votes:
            return True
        if self.expectation is Expectation.REFUSE or len(self.votes) > 1:
            return False
        gap, own, other = self.reference_gap_mm, self.surface_mm, self.reference_surface_mm
        if gap is None or own is None or other is None:
            return False  # nothing speaks for it
        return gap <= SAME_POSE_MM or (gap <= NEIGHBOUR_MM and own < other)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignReport:
    """Every search, and where the reference poses come from."""

    format: str
    reference: str
    records: tuple[ForeignRecord, ...]


def evaluate_foreign(
    folder: str | Path, *, reference: str | Path, motor_scan: str | Path, motor_view: str | Path
) -> ForeignReport:
    """Look for the model in both scenes, and for what is not there.

    Args:
        folder: Where `opencv-doc` keeps the data of its surface matching example.
        reference: JSON with `source` and, by scene, `camera_from_model` (4x4 rows, frames of the
            files) of another program.
        motor_scan: A full scan of a motor, to be looked for where no motor is.
        motor_view: A view of a clamped motor, to look for the model in.

    Returns:
        The report.

    Raises:
        InputFileError: A file is missing or broken.
    """
    root = Path(folder)
    poses = _read_reference(Path(reference))
    model = prepare_prior(prior_of_object(_turned(read_scan(root / MODEL)).points, "model"))
    motor = prepare_prior(prior_of_object(read_scan(motor_scan).points, "motor"))
    records: list[ForeignRecord] = []
    for name in SCENES:
        scan = _turned(read_scan(root / name))
        found, result = _search(f"model in {name}", model, scan, poses.get(name))
        records.append(found)
        mirrored, _ = _search(f"model in {name}, mirrored", model, mirror_scan(scan))
        records.append(mirrored)
        if result.poses:
            is_object = relabel(model, result.poses[0], scan.points, threshold_mm=5.0)
            emptied, _ = _search(f"model in {name}, taken out", model, scan.subset(~is_object))
            records.append(emptied)
        other, _ = _search(f"a motor in {name}", motor, scan)
        records.append(other)
    view, _ = _search("model in a view of a clamped motor", model, read_scan(motor_view))
    records.append(view)
    return ForeignReport(
        format=FORMAT, reference=_reference_source(Path(reference)), records=tuple(records)
    )


def write_foreign(path: str | Path, report: ForeignReport) -> None:
    """Write a report as JSON; the file appears whole or not at all."""
    text = (json.dumps(encode(report), indent=1, allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(Path(path), write)


def read_foreign(path: str | Path) -> ForeignReport:
    """Read a report.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        return decode(ForeignReport, json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a report on foreign scans") from error


def render_foreign(report: ForeignReport) -> str:
    """Write the section of `docs/results.md`, Markdown."""
    rows = [
        (
            record.name,
            record.expectation.value.replace("_", " "),
            str(record.places),
            str(record.accepted),
            str(len(record.votes)),
            _refused(record),
            _gap(record),
            _distances(record),
            "" if record.best_coverage is None else f"{100 * record.best_coverage:.1f} %",
            "yes" if record.is_as_wanted else "**no**",
            f"{record.cpu_s / max(record.places, 1):.1f}",
        )
        for record in report.records
    ]
    table = markdown_table(
        (
            "looked for",
            "allowed",
            "places",
            "accepted",
            "distinct poses",
            "right pose, but refused by",
            "off the reference pose, worst point",
            "surface off the scan, median: here / reference",
            "free surface measured",
            "as wanted",
            "CPU s per place",
        ),
        rows,
    )
    return (
        f"Source: {SOURCE}. Real laser scans, mm, of toys; no truth comes with them. The networks "
        "know motors only, so a ball about every place of the scene is offered as mask "
        "(`boltpose.evaluation.object_search`); registration, its settings and the verdict's "
        "thresholds are the shipped ones, derived from simulated motors. Reference pose: "
        f"{report.reference}.\n\n{table}" + _domain_gap(report)
    )


def _gap(record: ForeignRecord) -> str:
    if record.reference_gap_mm is None or record.reference_gap_rad is None:
        return ""
    return f"{record.reference_gap_mm:.1f} mm, {np.degrees(record.reference_gap_rad):.2f} deg"


def _domain_gap(report: ForeignReport) -> str:
    if not any(record.right_but_refused for record in report.records):
        return ""
    return (
        "\n\nRight poses were found and refused. That is the safe side, and a gap between the "
        "simulated camera, whose error `EvidenceConfig.tight_mm` is four times of, and this "
        "scanner with its coarser model: on another sensor the verdict's fit thresholds have to "
        "be derived again (`boltpose.evaluation.hard_run`, `hard_fit`)."
    )


def _refused(record: ForeignRecord) -> str:
    if not record.right_but_refused:
        return ""
    checks = ", ".join(f"{name} {count}" for name, count in record.right_failed.items())
    return f"{record.right_but_refused} places: {checks}"


def _distances(record: ForeignRecord) -> str:
    if record.surface_mm is None or record.reference_surface_mm is None:
        return ""
    return f"{record.surface_mm:.2f} / {record.reference_surface_mm:.2f} mm"


def _search(
    name: str, prepared: PreparedPrior, scan: Scan, reference: Transform | None = None
) -> tuple[ForeignRecord, SearchResult]:
    is_there = reference is not None
    clock = CallClock()
    result = search_object(prepared, scan)
    time = clock.stop()
    accepted = [f for f in result.findings if f.verdict.status is Status.OK]
    gap_mm: float | None = None
    gap_rad: float | None = None
    surface_mm: float | None = None
    reference_surface_mm: float | None = None
    if reference is not None and result.poses:
        pose = result.poses[0]
        shift = pose.apply(prepared.points) - reference.apply(prepared.points)
        gap_mm = float(np.linalg.norm(shift, axis=1).max())
        gap_rad = rotation_angle_rad(pose.rotation.T @ reference.rotation)
        surface_mm = _surface_distance(prepared, scan, pose)
        reference_surface_mm = _surface_distance(prepared, scan, reference)
    right = [] if reference is None else _right_but_refused(result, prepared, reference)
    return ForeignRecord(
        name=name,
        expectation=Expectation.RIGHT_OR_REFUSE if is_there else Expectation.REFUSE,
        places=len(result.findings),
        accepted=len(accepted),
        votes=result.votes,
        reference_gap_mm=gap_mm,
        reference_gap_rad=gap_rad,
        surface_mm=surface_mm,
        reference_surface_mm=reference_surface_mm,
        right_but_refused=len(right),
        right_failed=dict(Counter(str(check) for v in right for check in v.failed)),
        failed=dict(Counter(str(check) for f in result.findings for check in f.verdict.failed)),
        best_coverage=float(accepted[0].verdict.scores["coverage"]) if accepted else None,
        cpu_s=time.cpu_s,
    ), result


def _right_but_refused(
    result: SearchResult, prepared: PreparedPrior, reference: Transform
) -> list[Verdict]:
    true_points = reference.apply(prepared.points)
    verdicts: list[Verdict] = []
    for finding in result.findings:
        if finding.registration is None or finding.verdict.status is Status.OK:
            continue
        shift = finding.registration.camera_from_prior.apply(prepared.points) - true_points
        if float(np.linalg.norm(shift, axis=1).max()) <= NEIGHBOUR_MM:
            verdicts.append(finding.verdict)
    return verdicts


def _surface_distance(prepared: PreparedPrior, scan: Scan, pose: Transform) -> float:
    """Median distance, mm, of the posed object's visible surface from the nearest scan point."""
    standing = judge_surface(build_scene(scan.points), pose, prepared, tolerance_mm=8.0)
    surface = pose.apply(prepared.coarse_points[standing == Standing.CONFIRMED])
    distance, _ = KDTree(scan.points).query(surface, workers=-1)
    return float(np.median(distance))


def _turned(scan: Scan) -> Scan:
    """Turn files whose camera looks along -z by half a turn about x, into frame `camera`."""
    if np.median(scan.points[:, 2]) > 0:
        return scan
    return Scan(points=scan.points * (1.0, -1.0, -1.0), source=scan.source)


def _read_reference(path: Path) -> dict[str, Transform]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        turn = np.diag([1.0, -1.0, -1.0, 1.0])  # model and scene files alike look along -z
        return {
            str(name): Transform("camera", "prior", turn @ np.array(rows, dtype=np.float64) @ turn)
            for name, rows in content["camera_from_model"].items()
        }
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputFileError(path, str(error), "reference poses of both scenes") from error


def _reference_source(path: Path) -> str:
    return str(json.loads(path.read_text(encoding="utf-8"))["source"])
