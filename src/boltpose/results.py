"""`poses.json`: the result of one scan as a robot cell reads it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from boltpose.errors import InputFileError
from boltpose.io.atomic import write_atomic
from boltpose.io.guard import require_file
from boltpose.schema import (
    BoltState,
    Check,
    LocatedBolt,
    LocateResult,
    Registration,
    Side,
    Status,
    Visibility,
)

SCHEMA = "boltpose.poses/4"
SCHEMA_FILE = Path(__file__).parent / "poses.schema.json"
"""The JSON Schema of the file, shipped with the package."""

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vector], Field(min_length=3, max_length=3)]
Row4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Matrix4 = Annotated[list[Row4], Field(min_length=4, max_length=4)]
Row6 = Annotated[list[float], Field(min_length=6, max_length=6)]
Matrix6 = Annotated[list[Row6], Field(min_length=6, max_length=6)]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]


class _Record(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class BoltPose(_Record):
    """One bolt in the file's frame; lengths mm."""

    id: str
    name: str
    """What people call it; empty: its id is its name."""
    tool: str
    """The tool that turns it, in the cell's own words; empty: not said."""
    order: int | None
    """Its turn when bolts are taken out, from 1; null: after all that have one."""
    side: Side
    head_top: Vector
    """The point on the axis on the top face of the head, where the tool lands."""
    position: Vector
    """The head's centre: on the axis, half way up the head."""
    cluster_centre: Vector
    """The paper's position: mean of the bolt's points in the full scan."""
    axis: Vector
    """Unit, out of the head."""
    rotation: Matrix3
    """Columns are the axes of frame `bolt`; the third is `axis`."""
    quaternion_wxyz: Row4
    head_diameter_mm: Positive
    head_height_mm: Positive
    visibility: Visibility
    visible_share: Share
    confidence: Share
    sure: bool
    remarks: list[str]
    covariance_mm2: Matrix3
    """Of `head_top`; the hand-eye's own error is in it only if it was told."""
    sigma_lateral_mm: Positive
    sigma_axial_mm: Positive
    sigma_axis_deg: Positive
    state: BoltState
    """What the camera says: is the head where the prior promises it?"""
    state_reason: str
    """What was seen instead; empty unless contradicted."""
    p_tool_fits: Share | None
    """Probability that the given tool lands on the bolt; null if no tool was given."""

    @model_validator(mode="after")
    def _is_a_proper_pose(self) -> Self:
        rotation = np.array(self.rotation)
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6):
            raise ValueError(f"rotation of bolt {self.id} is not orthonormal")
        if np.linalg.det(rotation) < 0:
            raise ValueError(f"rotation of bolt {self.id} mirrors")
        if not np.allclose(rotation[:, 2], self.axis, atol=1e-6):
            raise ValueError(f"axis of bolt {self.id} is not the third column of its rotation")
        if (self.state is BoltState.CONTRADICTED) != bool(self.state_reason):
            raise ValueError(f"bolt {self.id}: a contradiction, and only that, has a reason")
        return self


class ExtraHeadPose(_Record):
    """What looks like the head of a bolt where the prior has none, in the file's frame."""

    head_top: Vector
    diameter_mm: Positive
    height_mm: Positive


class VariantPose(_Record):
    """How one of several known motors fits the scan."""

    name: str
    status: Status
    p_correct: Share
    score: float | None
    """Share of the motor points that agree with it; null if no pose was found."""


class Candidate(_Record):
    """A pose with what the fit itself says of it; none of it is a measure of truth."""

    camera_from_prior: Matrix4
    converged: bool
    rms_mm: float
    inlier_ratio: Share
    score: float
    runner_up_score: float
    covariance: Matrix6
    """Rotation vector (rad) then translation (mm), frame `camera`, about `centre_mm`."""
    centre_mm: Vector


class PosesContent(_Record):
    """All that `poses.json` says; matrices row-major, `target_from_source`, points as columns."""

    schema_: Literal["boltpose.poses/4"] = Field(alias="schema")
    status: Status
    reason: Check | None
    """The most telling failed check; null when ok."""
    failed: list[Check]
    """Every failed check, the most telling first."""
    reasons: list[str]
    """One sentence per failed check, in the order they were made: found and wanted."""
    frame: Literal["base", "camera"]
    unit: Literal["mm"]
    prior: str
    p_correct: Share
    """Probability that every bolt is at most 2 mm and 2 degrees off as the camera sees the motor;
    the hand-eye's error is not in it but in every bolt's sigmas."""
    bolts: list[BoltPose]
    extra_heads: list[ExtraHeadPose]
    """What looks like heads that the prior does not know: a hint for a person; it may be a screw of
    the clamp."""
    variants: list[VariantPose]
    """The known motors that were tried, best first; empty if the motor was given."""
    camera_from_prior: Matrix4 | None
    """Null when refused: see `rejected_candidate`."""
    base_from_camera: Matrix4 | None
    """The hand-eye that was used; null in frame `camera`."""
    registration: Candidate | None
    rejected_candidate: Candidate | None
    """The best pose found, for diagnosis only."""
    quality: dict[str, float]
    """Every score behind the verdict."""
    thresholds: dict[str, float]
    timings_ms: dict[str, float]
    """Wall time per stage; all else is the same for the same input, bit for bit."""
    provenance: dict[str, Any]

    @model_validator(mode="after")
    def _refuses_without_poses(self) -> Self:
        is_ok = self.status is Status.OK
        if self.reason != (self.failed[0] if self.failed else None):
            raise ValueError("reason must be the first failed check")
        if is_ok != (self.reason is None) or is_ok != (self.camera_from_prior is not None):
            raise ValueError("a reason without a pose, or a pose without a reason: never both")
        if not is_ok and self.bolts:
            raise ValueError("a refused file holds no bolts")
        if (self.frame == "base") != (self.base_from_camera is not None):
            raise ValueError("frame `base` and only that needs base_from_camera")
        if len({bolt.id for bolt in self.bolts}) != len(self.bolts):
            raise ValueError("two bolts have one id")
        return self

    def digest(self) -> str:
        """SHA-256 of the content but for `timings_ms`, whatever its layout; hexadecimal."""
        covered = set(PosesContent.model_fields) - {"timings_ms"}
        data = self.model_dump(mode="json", by_alias=True, include=covered)
        text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


class PosesFile(PosesContent):
    """All of `poses.json`: what it says, and a seal that a change by hand breaks."""

    content_sha256: str
    """SHA-256 of all else but `timings_ms`: keys sorted, no spaces, floats as Python writes them.
    A seal against slips, not against intent: who wants to can compute it again."""

    @model_validator(mode="after")
    def _is_as_it_was_written(self) -> Self:
        if self.content_sha256 != self.digest():
            raise ValueError(
                "content_sha256 does not fit: changed since boltpose wrote it, locate again"
            )
        return self


def to_file(result: LocateResult, timings_ms: Mapping[str, float] | None = None) -> PosesFile:
    """Turn a result into the checked content of `poses.json`.

    Args:
        result: What `locate` returned.
        timings_ms: Wall time per stage.
    """
    is_ok = result.is_ok
    candidate = None if result.registration is None else _candidate(result.registration)
    failed = sorted(result.verdict.failed, key=list(Check).index)
    content = PosesContent(
        schema=SCHEMA,
        status=result.verdict.status,
        reason=failed[0] if failed else None,
        failed=failed,
        reasons=list(result.verdict.reasons),
        frame="base" if result.frame == "base" else "camera",
        unit="mm",
        prior=result.prior_name,
        p_correct=result.verdict.p_correct,
        bolts=[_bolt(bolt) for bolt in result.bolts],
        extra_heads=[
            ExtraHeadPose(
                head_top=head.head_top_mm.tolist(),
                diameter_mm=head.diameter_mm,
                height_mm=head.height_mm,
            )
            for head in result.extra_heads
        ],
        variants=[
            VariantPose(
                name=variant.name,
                status=variant.status,
                p_correct=variant.p_correct,
                score=variant.score if math.isfinite(variant.score) else None,
            )
            for variant in result.variants
        ],
        camera_from_prior=candidate.camera_from_prior if candidate and is_ok else None,
        base_from_camera=(
            None if result.base_from_camera is None else result.base_from_camera.matrix.tolist()
        ),
        registration=candidate if is_ok else None,
        rejected_candidate=None if is_ok else candidate,
        quality=dict(result.verdict.scores),
        thresholds=dict(result.verdict.thresholds),
        timings_ms={name: round(value, 3) for name, value in (timings_ms or {}).items()},
        provenance=json.loads(json.dumps(dict(result.provenance))),
    )
    data = content.model_dump(by_alias=True)
    return PosesFile.model_validate(data | {"content_sha256": content.digest()})


def dump_json(result: LocateResult, timings_ms: Mapping[str, float] | None = None) -> str:
    """The text of `poses.json`."""
    data = to_file(result, timings_ms).model_dump(mode="json", by_alias=True)
    return json.dumps(data, indent=2, allow_nan=False) + "\n"


def write_poses(
    path: str | Path, result: LocateResult, timings_ms: Mapping[str, float] | None = None
) -> None:
    """Write `poses.json`; the file appears whole or not at all.

    Raises:
        OSError: The file cannot be written there.
    """
    text = dump_json(result, timings_ms).encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(Path(path), write)


def read_poses(path: str | Path) -> PosesFile:
    """Read and check a `poses.json`.

    Raises:
        InputFileError: The file is missing, no JSON, breaks the schema or was changed by hand.
    """
    wanted = f"a poses.json of `boltpose locate -o`, schema {SCHEMA}"
    try:
        text = require_file(path, wanted).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputFileError(path, f"no readable text ({error})", wanted) from error
    try:
        return PosesFile.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise InputFileError(path, f"{where}: {first['msg']}", wanted) from error


def json_schema() -> str:
    """The JSON Schema of `poses.json`, as shipped in `SCHEMA_FILE`."""
    return json.dumps(PosesFile.model_json_schema(by_alias=True), indent=2) + "\n"


def _bolt(bolt: LocatedBolt) -> BoltPose:
    return BoltPose(
        id=bolt.id,
        name=bolt.name,
        tool=bolt.tool,
        order=bolt.order,
        side=bolt.side,
        head_top=bolt.head_top.tolist(),
        position=bolt.position.tolist(),
        cluster_centre=bolt.cluster_centre.tolist(),
        axis=bolt.axis.tolist(),
        rotation=bolt.frame_from_bolt.rotation.tolist(),
        quaternion_wxyz=bolt.frame_from_bolt.quaternion_wxyz.tolist(),
        head_diameter_mm=bolt.head_diameter_mm,
        head_height_mm=bolt.head_height_mm,
        visibility=bolt.visibility,
        visible_share=bolt.visible_fraction,
        confidence=bolt.confidence,
        sure=bolt.is_sure,
        remarks=list(bolt.remarks),
        covariance_mm2=bolt.covariance_mm2.tolist(),
        sigma_lateral_mm=bolt.sigma_lateral_mm,
        sigma_axial_mm=bolt.sigma_axial_mm,
        sigma_axis_deg=float(np.degrees(bolt.sigma_axis_rad)),
        state=bolt.state,
        state_reason=bolt.state_reason,
        p_tool_fits=bolt.p_tool_fits,
    )


def _candidate(registration: Registration) -> Candidate:
    return Candidate(
        camera_from_prior=registration.camera_from_prior.matrix.tolist(),
        converged=registration.converged,
        rms_mm=registration.rms_mm,
        inlier_ratio=registration.inlier_ratio,
        score=registration.score,
        runner_up_score=registration.runner_up_score,
        covariance=registration.covariance.tolist(),
        centre_mm=registration.centre_mm.tolist(),
    )
