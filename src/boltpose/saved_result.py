"""A `poses.json` opened again, with the scan and the prior it was made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boltpose.errors import InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.io.digest import sha256_of
from boltpose.io.scan import read_scan
from boltpose.prior.file import read_prior
from boltpose.prior.folder import open_prior_folder
from boltpose.results import BoltPose, Candidate, PosesFile, read_poses
from boltpose.schema import (
    ExtraHead,
    LocatedBolt,
    LocateResult,
    Prior,
    Registration,
    Scan,
    VariantScore,
    Verdict,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SavedResult:
    """What `locate` returned, and what it was given."""

    path: Path
    result: LocateResult
    timings_ms: Mapping[str, float]
    scan: Scan
    """Of several scans the one that `result.registration` is about."""
    prior: Prior


def open_saved_result(
    path: str | Path, scan: str | Path | None = None, prior: str | Path | None = None
) -> SavedResult:
    """Read a `poses.json`, its scan and its prior.

    Files that are not named are looked for where they were when the result was made, and then,
    by their names, beside the `poses.json`. What is found must have the bytes it was made from:
    another scan under a result would be a lie.

    Args:
        path: The `poses.json`.
        scan: Its scan; None looks for it.
        prior: Its prior, or the folder of priors it chose from; None looks for it.

    Raises:
        InputFileError: A file is missing, cannot be used, or is not the one the result is about.
        UnitError: The scan is not in the unit it was located with.
    """
    file = read_poses(path)
    provenance = file.provenance
    inputs = provenance.get("inputs")
    inputs = inputs if isinstance(inputs, dict) else {}
    scans = [str(name) for name in _as_list(inputs.get("scans"))]
    row = _reference_row(scans, str(provenance.get("reference_view", "")))
    hashes = _as_list(provenance.get("scan_sha256"))
    scan_path = _find(path, scan, scans[row] if scans else None, "the scan", "--scan")
    _check_bytes(scan_path, hashes[row] if row < len(hashes) else None, path)
    prior_path = _find(path, prior, inputs.get("prior"), "the prior", "--prior")
    if prior_path.is_dir():
        known_paths = open_prior_folder(prior_path).paths
        if file.prior not in known_paths:
            raise InputFileError(prior_path, f"no prior of the name '{file.prior}'", "--prior FILE")
        prior_path = known_paths[file.prior]
    _check_bytes(prior_path, provenance.get("prior_sha256"), path)
    known = read_prior(prior_path)
    camera = inputs.get("camera")
    return SavedResult(
        path=Path(path),
        result=result_of(file),
        timings_ms=file.timings_ms,
        scan=read_scan(
            scan_path,
            unit=str(inputs.get("scan_unit", "mm")),
            camera=None if camera is None else _find(path, None, camera, "the camera", "--scan"),
        ),
        prior=known,
    )


def result_of(file: PosesFile) -> LocateResult:
    """Turn the content of a `poses.json` back into what `locate` returned.

    Of it only `motor_mask`, which no file keeps, is lost.
    """
    candidate = file.registration or file.rejected_candidate
    base_from_camera = file.base_from_camera
    return LocateResult(
        verdict=Verdict(
            status=file.status,
            failed=tuple(file.failed),
            reasons=tuple(file.reasons),
            scores=dict(file.quality),
            thresholds=dict(file.thresholds),
            p_correct=file.p_correct,
        ),
        frame=file.frame,
        bolts=tuple(_bolt(bolt, file.frame) for bolt in file.bolts),
        registration=None if candidate is None else _registration(candidate),
        prior_name=file.prior,
        base_from_camera=(
            None
            if base_from_camera is None
            else Transform("base", "camera", np.array(base_from_camera))
        ),
        extra_heads=tuple(
            ExtraHead(
                head_top_mm=np.array(head.head_top),
                diameter_mm=head.diameter_mm,
                height_mm=head.height_mm,
            )
            for head in file.extra_heads
        ),
        variants=tuple(
            VariantScore(
                name=variant.name,
                status=variant.status,
                p_correct=variant.p_correct,
                score=-np.inf if variant.score is None else variant.score,
            )
            for variant in file.variants
        ),
        provenance=file.provenance,
    )


def _bolt(bolt: BoltPose, frame: str) -> LocatedBolt:
    return LocatedBolt(
        id=bolt.id,
        side=bolt.side,
        frame_from_bolt=Transform.from_parts(frame, "bolt", bolt.rotation, bolt.head_top),
        visible_fraction=bolt.visible_share,
        visibility=bolt.visibility,
        sigma_lateral_mm=bolt.sigma_lateral_mm,
        sigma_axial_mm=bolt.sigma_axial_mm,
        sigma_axis_rad=float(np.radians(bolt.sigma_axis_deg)),
        covariance_mm2=np.array(bolt.covariance_mm2),
        head_diameter_mm=bolt.head_diameter_mm,
        head_height_mm=bolt.head_height_mm,
        confidence=bolt.confidence,
        is_sure=bolt.sure,
        cluster_centre=np.array(bolt.cluster_centre),
        remarks=tuple(bolt.remarks),
        state=bolt.state,
        state_reason=bolt.state_reason,
        p_tool_fits=bolt.p_tool_fits,
        name=bolt.name,
        tool=bolt.tool,
        order=bolt.order,
    )


def _registration(candidate: Candidate) -> Registration:
    return Registration(
        camera_from_prior=Transform("camera", "prior", np.array(candidate.camera_from_prior)),
        converged=candidate.converged,
        rms_mm=candidate.rms_mm,
        inlier_ratio=candidate.inlier_ratio,
        covariance=np.array(candidate.covariance),
        centre_mm=np.array(candidate.centre_mm),
        runner_up_score=candidate.runner_up_score,
        score=candidate.score,
    )


def _as_list(value: Any) -> list[Any]:
    if value is None:
        return []
    return list(value) if isinstance(value, list) else [value]


def _reference_row(scans: list[str], reference: str) -> int:
    """Which of several scans the registration is about; they may have been named relatively."""
    for row, name in enumerate(scans):
        if reference and Path(name).as_posix().endswith(Path(reference).as_posix().lstrip("./")):
            return row
    return 0


def _find(
    poses: str | Path, given: str | Path | None, noted: object, what: str, option: str
) -> Path:
    if given is not None:
        return Path(given)
    if noted is None:
        raise InputFileError(poses, f"no note of where {what} is", f"{option} FILE")
    old = Path(str(noted))
    for candidate in (old, Path(poses).parent / old.name):
        if candidate.exists():
            return candidate
    raise InputFileError(old, f"no such file, {what} of {poses}", f"it, or {option} FILE")


def _check_bytes(path: Path, wanted: object, poses: str | Path) -> None:
    if not path.is_file():
        raise InputFileError(path, "no such file", f"what {poses} was made from")
    if isinstance(wanted, str) and sha256_of(path) != wanted:
        raise InputFileError(path, "another file", f"the one {poses} was made from (SHA-256)")
