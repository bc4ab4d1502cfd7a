"""The true poses of a sample, as the JSON files of reman18 state them.

Frames by their letters there: A robot base, B camera, C full scan (`prior`), M `motor`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray, IntArray, UInt8Array
from boltpose.factory.model import MotorModel, TrueBolt
from boltpose.factory.spec import MotorSpec
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.synthesis.write import rounded

SAME_BOLT_MM = 3.0
"""A bolt of the clamped motor whose axis is this near is the one that was scanned; another head
on the same thread is that bolt too. Heads never stand that close."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenBolt:
    """What a view's sensor measured of one bolt."""

    visible_fraction: float
    """Share of the outer head surface, 0 to 1."""
    pixel_count: int

    @property
    def is_visible(self) -> bool:
        """As reman18 draws the line: a tenth of the head, and 30 pixels."""
        return self.visible_fraction >= 0.10 and self.pixel_count >= 30


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewBolt:
    """One bolt of the scanned motor in a view."""

    scanned: TrueBolt
    clamped: TrueBolt | None
    """None: it was gone before the motor was clamped."""
    head_centroid: FloatArray
    """Shape (3,), mm, frame `motor`: of the clamped head, or the scanned one where it is gone."""
    seen: SeenBolt


def match_bolts(
    scanned: Sequence[TrueBolt], clamped: Sequence[TrueBolt]
) -> tuple[TrueBolt | None, ...]:
    """Find every scanned bolt on the clamped motor.

    By place, not by id: ids count along the bolts, and bolts come and go.

    Args:
        scanned: Bolts of the motor when it was scanned.
        clamped: Bolts of the motor in the clamp.

    Returns:
        One bolt or None for every scanned bolt.
    """
    found: list[TrueBolt | None] = []
    for bolt in scanned:
        partner: TrueBolt | None = None
        for other in clamped:
            offset = other.head_top - bolt.head_top
            beside = float(np.linalg.norm(offset - bolt.axis * (bolt.axis @ offset)))
            # a head of another kind is higher or lower, on the other end of the motor it is not
            along = abs(float(bolt.axis @ offset))
            if other.side == bolt.side and beside < SAME_BOLT_MM and along < 15:
                partner = other
        found.append(partner)
    return tuple(found)


def prior_truth(
    model: MotorModel,
    prior_from_motor: Transform,
    labels: UInt8Array,
    *,
    number: int,
    family_number: int,
    seed: int,
    cell_mm: float,
    scan_points: Mapping[str, int],
    centroids: Mapping[str, FloatArray],
    retries: Sequence[str] = (),
) -> dict[str, Any]:
    """`prior_gt.json`: the motor as it was scanned.

    Args:
        model: The motor.
        prior_from_motor: Where the full scan has put it.
        labels: Shape (N,), classes of the scan's points.
        number: Of the sample.
        family_number: Of the family among those of the data set.
        seed: Of the data set.
        cell_mm: Spacing of the scan's points.
        scan_points: Points on every bolt, by id.
        centroids: Centre of every head's outer surface, shape (3,), mm, frame `motor`, by id.
        retries: Draws that could not be built.

    Returns:
        JSON-ready, with the keys of reman18 in their order, then our own.
    """
    spec = model.spec
    counts = np.bincount(labels, minlength=len(Part))
    return {
        "motor_id": number,
        "family": family_number,
        "family_name": spec.family,
        "seed": seed,
        "T_M_to_C": rounded(prior_from_motor.matrix),
        "n_points": len(labels),
        "class_points": {
            part.name.lower(): int(counts[part]) for part in Part if part is not Part.BACKGROUND
        },
        "spacing_cell_mm": rounded(cell_mm, 3),
        "n_bolts": len(model.bolts),
        "plug": spec.terminals.plug is not None,
        "cable": spec.terminals.cable is not None,
        "dims_mm": _dimensions(spec),
        "bolts": [
            {
                **_describe_bolt(index, bolt),
                "C": _place(prior_from_motor, bolt, centroids[bolt.id]),
                "motor": _place(Transform.identity("motor", "motor"), bolt, centroids[bolt.id]),
                "scan_points": scan_points.get(bolt.id, 0),
                "name": bolt.id,
            }
            for index, bolt in enumerate(model.bolts)
        ],
        "retries": list(retries),
    }


def camera_truth(camera_matrix: FloatArray, depth_scale_mm: float) -> dict[str, Any]:
    """One view of `scene_camera.json`."""
    return {"cam_K": rounded(camera_matrix.ravel()), "depth_scale": depth_scale_mm}


def scene_truth(
    number: int, camera_from_prior: Transform, base_from_camera: Transform
) -> list[dict[str, Any]]:
    """One view of `scene_gt.json`."""
    return [
        {
            "obj_id": number,
            "cam_R_m2c": rounded(camera_from_prior.rotation.ravel(), 9),
            "cam_t_m2c": rounded(camera_from_prior.translation_mm),
            "T_C_to_B": rounded(camera_from_prior.matrix, 9),
            "T_B_to_A": rounded(base_from_camera.matrix, 9),
        }
    ]


def view_truth(
    bolts: Sequence[ViewBolt],
    labels: UInt8Array,
    is_valid: IntArray | np.ndarray[Any, Any],
    *,
    clamp_number: int,
    clamp_name: str,
    prior_from_motor: Transform,
    camera_from_prior: Transform,
    base_from_camera: Transform,
    changes: Sequence[str] = (),
    retries: Sequence[str] = (),
) -> dict[str, Any]:
    """One view of `bolts.json`: every bolt of the scanned motor, seen or not.

    Args:
        bolts: In the order of `prior_gt.json`.
        labels: Shape (H, W), classes of pixels.
        is_valid: Shape (H, W), where a depth was measured.
        clamp_number: Of the design.
        clamp_name: Of the design.
        prior_from_motor: Where the full scan has put the motor.
        camera_from_prior: True pose of the motor.
        base_from_camera: The robot's hand-eye.
        changes: What has happened to the motor since its scan.
        retries: Draws of this view that could not be built.

    Returns:
        JSON-ready. Poses are those of the clamped bolt; of one that is gone, `present` false, they
        are where it was.
    """
    camera_from_motor = camera_from_prior @ prior_from_motor
    base_from_motor = base_from_camera @ camera_from_motor
    frames = {"C": prior_from_motor, "B": camera_from_motor, "A": base_from_motor}
    entries: list[dict[str, Any]] = []
    for index, bolt in enumerate(bolts):
        shown = bolt.clamped or bolt.scanned
        entries.append(
            {
                **_describe_bolt(index, shown),
                **{
                    letter: _place(target_from_motor, shown, bolt.head_centroid)
                    for letter, target_from_motor in frames.items()
                },
                "visible_fraction": rounded(bolt.seen.visible_fraction, 3),
                "n_pixels": bolt.seen.pixel_count,
                "visible": bolt.seen.is_visible,
                "name": bolt.scanned.id,
                "present": bolt.clamped is not None,
            }
        )
    return {
        "clamp_design": clamp_number,
        "clamp_name": clamp_name,
        "motor_pixels": int(np.count_nonzero(labels)),
        "valid_pixels": int(np.count_nonzero(is_valid)),
        "bolts": entries,
        "changes": list(changes),
        "retries": list(retries),
    }


def _describe_bolt(index: int, bolt: TrueBolt) -> dict[str, Any]:
    return {
        "id": index,
        "group": str(bolt.spec.site),
        "head": str(bolt.spec.head),
        "M": bolt.spec.thread_mm,
        "across": rounded(bolt.across_mm),
        "head_diameter": rounded(bolt.head_diameter_mm),
        "head_height": rounded(bolt.head_height_mm),
        "side": str(bolt.side),
        "recess": rounded(bolt.spec.recess_mm),
    }


def _place(target_from_motor: Transform, bolt: TrueBolt, centroid: FloatArray) -> dict[str, Any]:
    centre = rounded(target_from_motor.apply(bolt.head_centre))
    return {
        "position": centre,
        "head_top": rounded(target_from_motor.apply(bolt.head_top)),
        "head_centre": centre,
        "head_centroid": rounded(target_from_motor.apply(centroid)),
        "axis": rounded(target_from_motor.rotate(bolt.axis)),
    }


def _dimensions(spec: MotorSpec) -> dict[str, float]:
    """Radius and length of the yoke and of the solenoid, and how far apart their axes are."""
    solenoid = spec.solenoid
    return {
        "R": rounded(spec.housing.radius_mm),
        "L": rounded(spec.housing.length_mm),
        "Rs": rounded(solenoid.radius_mm if solenoid else 0),
        "Ls": rounded(solenoid.length_mm if solenoid else 0),
        "offset": rounded(solenoid.offset_mm if solenoid else 0),
    }
