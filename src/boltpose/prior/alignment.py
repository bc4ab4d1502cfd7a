"""The motor's axes from its labelled full scan (normal alignment)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, UInt8Array, as_points
from boltpose.errors import ConfigError, DegenerateGeometryError, ShapeError
from boltpose.geometry.primitives import fit_circle, plane_basis
from boltpose.geometry.transforms import Transform
from boltpose.prior.housing_axis import HousingAxis, HousingAxisConfig, find_housing_axis
from boltpose.schema import Alignment, Part, Side


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentConfig:
    """Normal alignment of a full scan."""

    axis: HousingAxisConfig = field(default_factory=HousingAxisConfig)
    """How the main housing's axis is found."""
    min_part_points: int = 100
    """Fewer points of a part do not count as that part; a wrong label comes in small patches."""
    min_connector_distance_mm: float = 10.0
    """The connector's centre must lie this far along the axis to tell z's sign."""
    solenoid_radius_range_mm: tuple[float, float] = (8.0, 60.0)
    """Radii tried for the solenoid's body."""
    min_solenoid_offset: float = 0.5
    """Distance of the solenoid's centre from the housing's axis, in housing radii, from which it
    determines a direction."""
    seed: int = 0
    """Of every random draw: the same scan gives the same axes."""

    def __post_init__(self) -> None:
        if self.min_part_points < 20:
            raise ConfigError(f"min_part_points must be >= 20, got {self.min_part_points}")
        for name in ("min_connector_distance_mm", "min_solenoid_offset"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        low, high = self.solenoid_radius_range_mm
        if not 0 < low < high:
            raise ConfigError(f"solenoid_radius_range_mm must increase from > 0, got {low}, {high}")


def align_motor(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    labels: npt.ArrayLike,
    config: AlignmentConfig | None = None,
) -> Alignment:
    """Find frame `motor`: z along the housing's axis to the connector, y to the solenoid.

    Args:
        points: Shape (N, 3), mm, frame `prior`, a complete scan.
        normals: Shape (N, 3), unit, outward.
        labels: Shape (N,), `Part` numbers.
        config: Settings.

    Returns:
        The frame with the spread of the normals it rests on. Its origin lies on the housing's
        axis at half the motor's length, electrical connector not counted. Without a solenoid
        the roll is fixed by the shape alone and `has_solenoid` is False.

    Raises:
        ShapeError: The three arrays do not belong together, or a value is not finite.
        DegenerateGeometryError: The housing's normals do not determine the axis, or there is no
            connector that tells the sign of z.

    Source:
        Paper, section 3.5. Changed: parts' centres are the axes of their cylinders where one is
        found (the mean of a part seen from one side lies beside it).
    """
    settings = config or AlignmentConfig()
    cloud = as_points(points, "points", at_least=3)
    outward = as_points(normals, "normals", at_least=3)
    parts = np.asarray(labels)
    if outward.shape != cloud.shape or parts.shape != (len(cloud),):
        raise ShapeError(
            f"normals and labels must have one row per point ({len(cloud)}), "
            f"got {outward.shape} and {parts.shape}"
        )
    parts = parts.astype(np.uint8)
    housing = parts == Part.MAIN_HOUSING
    if housing.sum() < settings.min_part_points:
        raise DegenerateGeometryError(
            f"{int(housing.sum())} points of the main housing, wanted at least "
            f"{settings.min_part_points}: they do not determine its axis"
        )
    rng = np.random.default_rng(settings.seed)
    axis = find_housing_axis(cloud[housing], outward[housing], settings.axis, rng)
    z = axis.direction * _sign_of_z(cloud, parts, axis, settings)
    y = _solenoid_direction(cloud, outward, parts, axis, z, settings, rng)
    has_solenoid = y is not None
    if y is None:
        y = _widest_direction(cloud, axis, z)
    centre = axis.point_mm + _middle_height(cloud, parts, axis.point_mm, z) * z
    rotation = np.stack([np.cross(y, z), y, z], axis=1)
    return Alignment(
        prior_from_motor=Transform.from_parts("prior", "motor", rotation, centre),
        axis_spread_rad=axis.spread_rad,
        axis_sigma_rad=axis.sigma_rad,
        normal_count=axis.normal_count,
        inlier_ratio=axis.inlier_ratio,
        has_solenoid=has_solenoid,
    )


def bolt_rotation(side: Side, alignment: Alignment) -> FloatArray:
    """Rotation prior_from_bolt, shape (3, 3), det +1: z out of the head of a bolt of that side.

    Source:
        Paper, equation 1, which negates the matrix for a bolt at the bottom; that is a mirror
        image, so we turn by 180 degrees about x instead.
    """
    rotation = alignment.prior_from_motor.rotation
    if side is Side.TOP:
        return rotation.copy()
    return rotation @ np.diag([1.0, -1.0, -1.0])


def _sign_of_z(
    cloud: FloatArray, parts: UInt8Array, axis: HousingAxis, config: AlignmentConfig
) -> float:
    connector = cloud[parts == Part.CONNECTOR]
    if len(connector) < config.min_part_points:
        raise DegenerateGeometryError(
            f"{len(connector)} points of the connector, wanted at least "
            f"{config.min_part_points}: the sign of the motor's z axis cannot be told"
        )
    housing = cloud[parts == Part.MAIN_HOUSING]
    reach = float((np.median(connector, axis=0) - np.median(housing, axis=0)) @ axis.direction)
    if abs(reach) < config.min_connector_distance_mm:
        raise DegenerateGeometryError(
            f"the connector's centre lies {abs(reach):.1f} mm along the axis from the housing's, "
            f"wanted at least {config.min_connector_distance_mm:g}: "
            f"the sign of the motor's z axis cannot be told"
        )
    return float(np.sign(reach))


def _solenoid_direction(
    cloud: FloatArray,
    outward: FloatArray,
    parts: UInt8Array,
    axis: HousingAxis,
    z: FloatArray,
    config: AlignmentConfig,
    rng: np.random.Generator,
) -> FloatArray | None:
    """Unit vector from the housing's axis to the solenoid's, or None without a solenoid."""
    solenoid = parts == Part.SOLENOID
    if solenoid.sum() < config.min_part_points:
        return None
    basis = plane_basis(z)
    flat = (cloud[solenoid] - axis.point_mm) @ basis.T
    sideways = outward[solenoid] @ basis.T
    length = np.linalg.norm(sideways, axis=1)
    upright = length > 0.98  # the flank of the body, not its end faces or cones
    centre = np.median(flat, axis=0)
    if upright.sum() >= config.min_part_points:
        try:
            circle = fit_circle(
                flat[upright],
                sideways[upright] / length[upright, None],
                rng=rng,
                radius_range_mm=config.solenoid_radius_range_mm,
            )
        except DegenerateGeometryError:
            pass  # a solenoid that is not round: its middle will do
        else:
            # a ridge or a mislabelled patch may be round too, but is a small part of it
            if circle.inliers.mean() > 0.2:
                centre = circle.centre_mm
    offset = float(np.linalg.norm(centre))
    if offset < config.min_solenoid_offset * axis.radius_mm:
        return None
    return centre @ basis / offset


def _widest_direction(cloud: FloatArray, axis: HousingAxis, z: FloatArray) -> FloatArray:
    """Unit vector across z along which the motor is widest, towards its heavier end."""
    relative = cloud - axis.point_mm
    flat = relative - np.outer(relative @ z, z)
    direction = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    direction = direction - (direction @ z) * z
    direction /= np.linalg.norm(direction)
    return direction * (1.0 if float(np.sum((flat @ direction) ** 3)) >= 0 else -1.0)


def _middle_height(
    cloud: FloatArray, parts: UInt8Array, point_mm: FloatArray, z: FloatArray
) -> float:
    """Height over `point_mm` of the motor's middle, electrical connector and strays left out."""
    body = cloud[parts != Part.ELECTRICAL_CONNECTOR]
    height = (body - point_mm) @ z
    ends = np.argsort(height)[np.r_[0 : min(200, len(body)), max(0, len(body) - 200) : len(body)]]
    # a stray point has no company, the end of the shaft has
    distance, _ = KDTree(body).query(body[ends], k=min(6, len(body)))
    solid = height[ends][distance[:, -1] < 3.0]
    if len(solid) == 0:
        return float((height.min() + height.max()) / 2)
    return float((solid.min() + solid.max()) / 2)
