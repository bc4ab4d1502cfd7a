"""Full scan with class probabilities -> every bolt of the motor."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, IntArray, as_points
from boltpose.errors import ConfigError, ShapeError
from boltpose.geometry.transforms import Transform
from boltpose.prior.alignment import bolt_rotation
from boltpose.prior.clustering import ClusterConfig, cluster_points
from boltpose.prior.head_fit import HeadFitConfig, fit_head
from boltpose.schema import Alignment, Part, PriorBolt, Side


@dataclass(frozen=True, slots=True, kw_only=True)
class FindBoltsConfig:
    """From class probabilities to bolts."""

    cluster: ClusterConfig = field(default_factory=ClusterConfig)
    head_fit: HeadFitConfig = field(default_factory=HeadFitConfig)
    min_support: float = 20.0
    """Head-fit support from which a bolt is sure."""
    min_probability: float = 0.6
    """Mean class probability from which a bolt is sure."""

    def __post_init__(self) -> None:
        if not self.min_support > 0:
            raise ConfigError(f"min_support must be > 0, got {self.min_support}")
        if not 0 <= self.min_probability <= 1:
            raise ConfigError(f"min_probability must be 0 to 1, got {self.min_probability}")


def find_bolts(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    alignment: Alignment,
    config: FindBoltsConfig | None = None,
) -> tuple[PriorBolt, ...]:
    """Find every bolt of a motor in its full scan.

    Args:
        points: Shape (N, 3), mm, frame `prior`.
        normals: Shape (N, 3), unit, outward.
        probabilities: Shape (N, 6), of the classes 1 to 6 of `Part`.
        alignment: The motor's axes.
        config: Settings.

    Returns:
        The bolts, top ones first, numbered by their angle around z from +y.

    Raises:
        ShapeError: The arrays do not belong together, or a value is not finite.

    Source:
        Paper, section 3.4, for the clusters and their centres.
    """
    settings = config or FindBoltsConfig()
    cloud = as_points(points, "points")
    outward = as_points(normals, "normals")
    share = np.asarray(probabilities, dtype=np.float64)
    if outward.shape != cloud.shape or share.shape != (len(cloud), 6):
        raise ShapeError(
            f"normals must be {cloud.shape} and probabilities ({len(cloud)}, 6), "
            f"got {outward.shape} and {share.shape}"
        )
    bolt_index = np.flatnonzero(share.argmax(axis=1) == int(Part.BOLT) - 1)
    tree = KDTree(cloud)
    found = [
        _fit_cluster(bolt_index[group], cloud, outward, share[:, -1], tree, alignment, settings)
        for group in cluster_points(cloud[bolt_index], settings.cluster)
    ]
    return _numbered(found, alignment)


def _fit_cluster(
    members: IntArray,
    cloud: FloatArray,
    outward: FloatArray,
    probability: FloatArray,
    tree: KDTree,
    alignment: Alignment,
    config: FindBoltsConfig,
) -> PriorBolt:
    motor_from_prior = alignment.prior_from_motor.inverse()
    facing = motor_from_prior.rotate(outward[members])[:, 2]
    top, bottom = int((facing > 0.8).sum()), int((facing < -0.8).sum())
    side = Side.TOP if top >= bottom else Side.BOTTOM
    rotation = bolt_rotation(side, alignment)
    local = cloud[members] @ rotation
    face = outward[members] @ rotation[:, 2] > 0.8
    if face.sum() >= 8:
        level = float(np.percentile(local[face, 2], 92))
    else:
        level = float(local[:, 2].max())
    centre = local.mean(axis=0)
    around = np.array(tree.query_ball_point(cloud[members].mean(axis=0), 16.0), dtype=np.int64)
    origin = np.array([0.0, 0.0, level])
    fit = fit_head(
        cloud[around] @ rotation - origin, outward[around] @ rotation, centre[:2], config.head_fit
    )
    mean_probability = float(probability[members].mean())
    remarks: list[str] = []
    if fit.support < config.min_support:
        remarks.append(f"little flank seen (support {fit.support:.0f})")
    if mean_probability < config.min_probability:
        remarks.append(f"class probability {mean_probability:.2f}")
    position = fit.centre_mm if fit.support > 5 else centre[:2]
    return PriorBolt(
        id="",
        side=side,
        prior_from_bolt=Transform.from_parts(
            "prior", "bolt", rotation, rotation @ np.array([position[0], position[1], level])
        ),
        cluster_centre=cloud[members].mean(axis=0),
        head_diameter_mm=2 * fit.radius_mm,
        point_count=len(members),
        class_probability=mean_probability,
        head_fit_support=fit.support,
        sigma_lateral_mm=fit.sigma_mm if fit.support > 5 else 1.0,
        sigma_axial_mm=0.05,
        is_sure=not remarks,
        remarks=tuple(remarks),
    )


def _numbered(bolts: list[PriorBolt], alignment: Alignment) -> tuple[PriorBolt, ...]:
    motor_from_prior = alignment.prior_from_motor.inverse()

    def place(bolt: PriorBolt) -> tuple[float, float]:
        x, y, _ = motor_from_prior.apply(bolt.prior_from_bolt.translation_mm)
        # from +y towards -x, as seen from the tip of z counter-clockwise
        angle = float(np.arctan2(-x, y)) % (2 * np.pi)
        return round(angle, 2), float(np.hypot(x, y))

    result: list[PriorBolt] = []
    for side in (Side.TOP, Side.BOTTOM):
        ordered = sorted((bolt for bolt in bolts if bolt.side is side), key=place)
        letter = "T" if side is Side.TOP else "B"
        result += [replace(bolt, id=f"{letter}{k}") for k, bolt in enumerate(ordered, start=1)]
    return tuple(result)
