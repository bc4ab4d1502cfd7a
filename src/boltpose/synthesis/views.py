"""One view of a data set: the motor changed, clamped and looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.errors import DegenerateGeometryError
from boltpose.factory.changes import Change, ChangedMotor, draw_changes
from boltpose.factory.model import MotorModel, SceneModel, TrueBolt
from boltpose.factory.scene import place_motor
from boltpose.factory.viewpoint import suggest_camera
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import CapturedView, capture_view
from boltpose.sensor.structured_light_config import StructuredLightConfig, sample_structured_light
from boltpose.synthesis.head_surface import sample_outer_head, seen_share
from boltpose.synthesis.motors import ScannedMotor
from boltpose.synthesis.region import draw_region
from boltpose.synthesis.retry import draw_until_built
from boltpose.synthesis.seeds import Purpose, generator
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.stopwatch import Stopwatch
from boltpose.synthesis.truth import SeenBolt, ViewBolt, match_bolts
from boltpose.synthesis.write import sample_name

MIN_MOTOR_SHARE = 0.01
"""Share of the image's pixels that must show the motor; fewer is an operator's mistake."""
_FILLED_SHARE = (0.4, 0.9)
"""How much of the image's width or height the motor takes up. Ours."""
_FOCAL_RANGE = (0.8, 2.6)
"""Focal lengths in image widths: of structured-light cameras from 0.9 (Zivid 2 M70) to 1.8 or so,
and what is left of the image when only a region of interest is read out."""
_ANGLES_SPREAD_DEG = 50.0
"""How far from the free side a camera goes on its way round a clamped motor."""
_ANGLES_APART_DEG = 20.0
"""Two shots from nearly the same place would tell nothing new."""
_ANGLES_FURTHER = 1.25
"""A camera stays at about its working distance."""
_PLACE_DRAWS = 400
_BASE_REACH_MM = (500.0, 1000.0)
_BASE_HEIGHT_MM = (-150.0, 250.0)
_BASE_LEAN_RAD = 0.03
"""A robot stands about upright, and about an arm's length from its table."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SampledView:
    """A view and its truth."""

    clamp_name: str
    captured: CapturedView
    camera_from_prior: Transform
    base_from_camera: Transform
    bolts: tuple[ViewBolt, ...]
    changes: tuple[Change, ...]
    """What has happened to the motor since its scan."""
    retries: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    table_from_camera: Transform
    captured: CapturedView


def sample_views(
    settings: DataSetSettings, motor: ScannedMotor, view: int, watch: Stopwatch
) -> tuple[SampledView, ...]:
    """Change a scanned motor, clamp it and look at it, each by chance.

    Args:
        settings: Of the data set.
        motor: The motor and its scan.
        view: Number of the clamping.
        watch: Where the time goes.

    Returns:
        One view, or `settings.angles` views of the same clamping by the same camera, whose
        systematic errors and settings are the same in all of them. The first is what it would be
        alone.

    Raises:
        InfeasibleSampleError: Many draws in a row could not be built.
    """
    number = motor.number

    def rng(purpose: Purpose, attempt: int, angle: int = 0) -> np.random.Generator:
        return generator(settings.seed, number, purpose, view=view, attempt=attempt, angle=angle)

    def draw(attempt: int) -> tuple[ChangedMotor, SceneModel, tuple[_Shot, ...]]:
        with watch.stage("change"):
            fresh, changed = (
                draw_changes(model, rng(Purpose.CHANGES, attempt))
                if settings.with_changes
                else ChangedMotor(model=model, changes=())
                for model in (motor.fresh, motor.model)
            )
        with watch.stage("clamp"):
            clamp_rng = rng(Purpose.CLAMP, attempt)
            # for a design that does not fit this motor any other one may step in
            clamp = str(clamp_rng.choice(settings.clamps))
            if attempt == 0:
                clamp = settings.clamp_of(number, view)
            placed = place_motor(fresh.model, clamp_rng, clamp)
            scene = put_worn_motor(placed, changed.model)
            table_from_camera = suggest_camera(scene, rng(Purpose.CAMERA, attempt))
        with watch.stage("view"):
            sensor_rng = rng(Purpose.SENSOR, attempt)
            camera = _choose_camera(scene, table_from_camera, settings, sensor_rng)
            config = sample_structured_light(sensor_rng, camera)
            caster = RayCaster(scene.solids)
            captured = capture_view(caster, table_from_camera, config, sensor_rng)
            shots = [_Shot(table_from_camera, captured)]
            for angle in range(1, settings.angles):
                places = [shot.table_from_camera for shot in shots]
                place = _move_camera(scene, places, config, rng(Purpose.CAMERA, attempt, angle))
                again = capture_view(
                    caster,
                    place,
                    config,
                    rng(Purpose.SENSOR, attempt, angle),
                    # the same camera before the same motor
                    lasting_rng=rng(Purpose.SENSOR, attempt),
                )
                shots.append(_Shot(place, again))
            region = draw_region(scene, rng(Purpose.REGION, attempt))
            if region is not None:
                shots = [
                    replace(shot, captured=region.cut(shot.captured, shot.table_from_camera))
                    for shot in shots
                ]
        for shot in shots:
            share = float(np.mean(shot.captured.labels != Part.BACKGROUND))
            if share < MIN_MOTOR_SHARE:
                raise DegenerateGeometryError(f"the motor is on {100 * share:.2f} % of the pixels")
        return changed, scene, tuple(shots)

    drawn = draw_until_built(f"{sample_name(number)} view {view}", draw)
    changed, scene, shots = drawn.result
    base_from_table = _place_robot(rng(Purpose.BASE, 0))
    views: list[SampledView] = []
    for shot in shots:
        camera_from_motor = shot.table_from_camera.inverse() @ scene.table_from_motor
        with watch.stage("truth"):
            bolts = _look_at_bolts(
                motor.model, changed.model, scene, camera_from_motor, shot.captured
            )
        views.append(
            SampledView(
                clamp_name=scene.clamp_name,
                captured=shot.captured,
                camera_from_prior=camera_from_motor @ motor.prior_from_motor.inverse(),
                base_from_camera=base_from_table @ shot.table_from_camera,
                bolts=bolts,
                changes=changed.changes,
                retries=drawn.retries,
            )
        )
    return tuple(views)


def put_worn_motor(scene: SceneModel, motor: MotorModel) -> SceneModel:
    """Put the worn motor where the fresh one was clamped.

    Fresh meshes have a tenth of the triangles, and a clamp touches metal: the tenths of a
    millimetre of rust and dirt under its jaws give way.
    """
    around = tuple(solid for solid in scene.solids if solid.part == Part.BACKGROUND)
    parts = tuple(part.moved(scene.table_from_motor) for part in motor.parts)
    return replace(scene, solids=(*around, *parts))


def _look_at_bolts(
    scanned: MotorModel,
    clamped: MotorModel,
    scene: SceneModel,
    camera_from_motor: Transform,
    captured: CapturedView,
) -> tuple[ViewBolt, ...]:
    solids = {solid.bolt_id: solid for solid in clamped.parts if solid.bolt_id is not None}
    rows = {solid.bolt_id: row for row, solid in enumerate(scene.solids) if solid.bolt_id}
    old_solids = {solid.bolt_id: solid for solid in scanned.parts if solid.bolt_id is not None}
    points_camera = captured.points()
    solid_of_point = captured.solid_index.reshape(-1)[captured.pixels]

    def look_at(bolt: TrueBolt, partner: TrueBolt | None) -> ViewBolt:
        if partner is None:
            surface = sample_outer_head(bolt, old_solids[bolt.id])
            seen = SeenBolt(visible_fraction=0.0, pixel_count=0)
        else:
            surface = sample_outer_head(partner, solids[partner.id])
            measured = points_camera[solid_of_point == rows[partner.id]]
            seen = SeenBolt(
                visible_fraction=seen_share(camera_from_motor.apply(surface), measured),
                pixel_count=len(measured),
            )
        return ViewBolt(
            scanned=bolt, clamped=partner, head_centroid=surface.mean(axis=0), seen=seen
        )

    partners = match_bolts(scanned.bolts, clamped.bolts)
    return tuple(
        look_at(bolt, partner) for bolt, partner in zip(scanned.bolts, partners, strict=True)
    )


def _choose_camera(
    scene: SceneModel,
    table_from_camera: Transform,
    settings: DataSetSettings,
    rng: np.random.Generator,
) -> PinholeCamera:
    """A lens that suits the motor and its distance, as whoever bought the camera chose it."""
    points = table_from_camera.inverse().apply(_motor_vertices(scene))
    size = np.array([settings.width_px, settings.height_px])
    spread = float((np.ptp(points[:, :2] / points[:, 2:], axis=0) / size).max())
    focal_px = rng.uniform(*_FILLED_SHARE) / spread
    shortest, longest = (float(size.max()) * factor for factor in _FOCAL_RANGE)
    # the optical axis misses the middle of the chip by up to some percent
    off = rng.normal(0, 0.01, 2).clip(-0.03, 0.03) * size.max()
    return PinholeCamera(
        width=settings.width_px,
        height=settings.height_px,
        focal_px=float(np.clip(focal_px, shortest, longest)),
        centre_px=(float((size[0] - 1) / 2 + off[0]), float((size[1] - 1) / 2 + off[1])),
    )


def _move_camera(
    scene: SceneModel,
    places: Sequence[Transform],
    config: StructuredLightConfig,
    rng: np.random.Generator,
) -> Transform:
    """Another place for a camera, from where its lens takes in the whole motor.

    Raises:
        DegenerateGeometryError: There is none.
    """
    vertices = _motor_vertices(scene)
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    first_mm = float(np.linalg.norm(places[0].translation_mm - middle))
    camera = config.camera
    for _ in range(_PLACE_DRAWS):
        place = suggest_camera(
            scene,
            rng,
            distance_mm=(first_mm / _ANGLES_FURTHER, first_mm * _ANGLES_FURTHER),
            spread_deg=_ANGLES_SPREAD_DEG,
        )
        cosines = [float(place.z_axis @ other.z_axis) for other in places]
        points = place.inverse().apply(vertices)
        pixels = points[:, :2] / points[:, 2:] * camera.focal_px + np.array(camera.centre_px)
        inside = (pixels >= 0) & (pixels <= (camera.width - 1, camera.height - 1))
        if max(cosines) < np.cos(np.radians(_ANGLES_APART_DEG)) and inside.all():
            return place
    raise DegenerateGeometryError(f"no place for shot {len(places)} shows the whole motor")


def _motor_vertices(scene: SceneModel) -> FloatArray:
    return np.concatenate(
        [solid.vertices for solid in scene.solids if solid.part != Part.BACKGROUND]
    )


def _place_robot(rng: np.random.Generator) -> Transform:
    """`base_from_table`."""
    turn = Rotation.from_euler(
        "zyx", [rng.uniform(0, 2 * np.pi), *rng.normal(0, _BASE_LEAN_RAD, 2)]
    )
    reach, around = rng.uniform(*_BASE_REACH_MM), rng.uniform(-np.pi / 2, np.pi / 2)
    place = (reach * np.cos(around), reach * np.sin(around), rng.uniform(*_BASE_HEIGHT_MM))
    return Transform.from_parts("base", "table", turn.as_matrix(), place)
