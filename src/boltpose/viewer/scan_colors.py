"""What the colours of a scan can mean."""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, IntArray, UInt8Array
from boltpose.geometry.transforms import Transform
from boltpose.picture import paint
from boltpose.report.residuals import FULL_MM, REACH_MM, residual_tints
from boltpose.schema import LocateResult, Part, Prior, Scan
from boltpose.viewer.shade import ScanNormals, light, lit_colors
from boltpose.viewer.sight import WORDS, MotorSight, Seen

_FIT_SURROUNDINGS = np.array([0.84, 0.86, 0.88])
_BEFORE = np.array([0.72, 0.52, 0.86])
_SEEN_TINTS = {
    Seen.SEEN: np.array([0.42, 0.72, 0.50]),
    Seen.HIDDEN: np.array([0.98, 0.70, 0.32]),
    Seen.UNMEASURED: np.array([0.96, 0.90, 0.52]),
    Seen.TURNED_AWAY: np.array([0.72, 0.80, 0.92]),
    Seen.SEEN_THROUGH: np.array([0.85, 0.20, 0.22]),
}


class ColorMode(StrEnum):
    """Choices of the page; the text is what the page shows."""

    PARTS = "parts of the motor"
    MOTOR = "motor and surroundings"
    VISIBILITY = "what the camera saw"
    DISTANCE = "distance to the prior"
    OWN = "colours of the camera"
    PLAIN = "plain"


class ScanColors:
    """Colours of one scan, worked out for the rows that are asked for.

    The light comes from the camera, as in the picture of a photo with flash: every point it
    measured is lit.
    """

    def __init__(self, scan: Scan, result: LocateResult | None, prior: Prior | None) -> None:
        """Fit normals.

        Args:
            scan: Frame `camera`.
            result: Made from it, if there is one; a rejected candidate is not used for colours.
            prior: Of the result.
        """
        self._scan = scan
        # a rejected pose must not paint parts onto the scan as if they had been found
        pose = result.registration if result is not None and result.is_ok else None
        self._prior_from_camera: Transform | None = None
        self._prior: Prior | None = None
        self._tree: KDTree | None = None
        if pose is not None and prior is not None and len(prior.points):
            self._prior_from_camera = pose.camera_from_prior.inverse()
            self._prior = prior
            self._tree = KDTree(prior.points)
        self._sight: MotorSight | None = None
        extent = float(np.ptp(scan.points, axis=0).max()) if len(scan) else 1.0
        self._normals = ScanNormals(scan.points, np.zeros(3), max(extent / 300, 0.5))

    def modes(self) -> list[ColorMode]:
        """What can be shown of this scan, the most telling first."""
        found = [ColorMode.PLAIN]
        if self._tree is not None:
            known = (ColorMode.MOTOR, ColorMode.PARTS, ColorMode.VISIBILITY, ColorMode.DISTANCE)
            found = [*known, *found]
        elif self._scan.labels is not None:
            found = [ColorMode.PARTS, *found]
        if self._scan.colors is not None:
            found.append(ColorMode.OWN)
        return found

    def of(self, mode: ColorMode, rows: IntArray) -> UInt8Array:
        """Colours to send.

        Args:
            mode: One of `modes()`.
            rows: Shape (K,), of the scan.

        Returns:
            Shape (K, 3), RGB.
        """
        points = self._scan.points[rows]
        if mode is ColorMode.OWN and self._scan.colors is not None:
            return np.asarray(self._scan.colors[rows], dtype=np.uint8)
        tints = self._tints(mode, points, rows)
        # towards the camera, which stands in the origin; up is its -y
        brightness = light(
            self._normals.at(points), np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0])
        )
        return lit_colors(tints, brightness)

    def prior_tints(self, mode: ColorMode) -> FloatArray | None:
        """Colours of the registered prior, shape (N, 3), 0 to 1; None if it has one colour."""
        if mode is not ColorMode.VISIBILITY or self._tree is None:
            return None
        table = np.array([_SEEN_TINTS[seen] for seen in Seen])
        return table[self.sight.of_prior]

    @property
    def sight(self) -> MotorSight:
        """What the camera saw of the motor; worked out when it is first asked for."""
        assert self._prior is not None
        assert self._prior_from_camera is not None
        if self._sight is None:
            self._sight = MotorSight(self._scan, self._prior, self._prior_from_camera.inverse())
        return self._sight

    def _tints(self, mode: ColorMode, points: FloatArray, rows: IntArray) -> FloatArray:
        tints = np.tile(paint.SURROUNDINGS, (len(points), 1))
        if mode is ColorMode.PARTS and self._scan.labels is not None:
            return paint.part_tints(self._scan.labels[rows])
        if mode is ColorMode.PLAIN or self._tree is None:
            return tints
        assert self._prior is not None
        assert self._prior_from_camera is not None
        in_prior = self._prior_from_camera.apply(points)
        distance, partner = self._tree.query(in_prior, distance_upper_bound=REACH_MM, workers=1)
        near = np.isfinite(distance)
        partner = np.asarray(partner)[near]
        if mode is ColorMode.PARTS:
            tints[near] = paint.part_tints(self._prior.labels[partner])
        elif mode is ColorMode.MOTOR:
            tints[near] = paint.MOTOR
        elif mode is ColorMode.VISIBILITY:
            tints[self.sight.is_before(points)] = _BEFORE
            tints[near] = _SEEN_TINTS[Seen.SEEN]
        else:
            tints[:] = _FIT_SURROUNDINGS
            offset = in_prior[near] - self._prior.points[partner]
            beside = np.abs(np.einsum("ni,ni->n", offset, self._prior.normals[partner]))
            tints[near] = residual_tints(beside)
        return tints


def legend(mode: ColorMode, *, from_file: bool) -> list[tuple[str, str]]:
    """What the colours mean: CSS colour and word, in order.

    Args:
        mode: What is shown.
        from_file: True if parts come from labels in the scan's own file.
    """
    if mode is ColorMode.PARTS:
        source = " (labels of the file)" if from_file else ""
        return [
            (css(np.array(paint.PART_COLORS[part])), part.name.replace("_", " ").lower() + source)
            for part in Part
        ]
    if mode is ColorMode.MOTOR:
        return [
            (css(paint.MOTOR), f"motor: within {REACH_MM:g} mm of the registered prior"),
            (css(paint.SURROUNDINGS), "anything else"),
        ]
    if mode is ColorMode.VISIBILITY:
        of_prior = [(css(_SEEN_TINTS[seen]), f"motor, {WORDS[seen]}") for seen in Seen]
        return [
            *of_prior,
            (css(_BEFORE), "stands before the motor"),
            (css(paint.SURROUNDINGS), "anything else"),
        ]
    if mode is ColorMode.DISTANCE:
        steps = np.array([0.0, 0.25, 0.5, 0.75, 1.0]) * FULL_MM
        ramp = [
            (css(tint), f"{value:g} mm" + (" and more" if value == FULL_MM else ""))
            for tint, value in zip(residual_tints(steps), steps, strict=True)
        ]
        return [*ramp, (css(_FIT_SURROUNDINGS), "not the motor")]
    return []


def css(tint: FloatArray) -> str:
    """Write a colour, shape (3,), 0 to 1, as CSS."""
    red, green, blue = (round(255 * float(value)) for value in tint)
    return f"rgb({red},{green},{blue})"
