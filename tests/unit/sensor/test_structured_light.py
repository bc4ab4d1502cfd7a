from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from threadpoolctl import threadpool_limits

from boltpose.factory.model import Material
from boltpose.factory.solids import box
from boltpose.geometry.transforms import Transform
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import CapturedView, capture_view
from boltpose.sensor.structured_light_config import (
    StructuredLightConfig,
    sample_structured_light,
)
from tests.unit.sensor.shapes import (
    CLEAN,
    SMALL,
    anywhere,
    as_solid,
    camera_at,
    distance_to_solids,
    slab,
    toy_motor,
)

MOTOR = toy_motor()
CASTER = RayCaster(MOTOR)
CONFIG = StructuredLightConfig(camera=SMALL, working_distance_mm=600, lone_mm=25)
NARROW = PinholeCamera(width=180, height=140, focal_px=1500.0)
QUIET = replace(
    CONFIG,
    noise_mm=0,
    ripple_mm=0,
    lumps_mm=0,
    warp_mm=0,
    contrast_mm=0,
    highlight_mm=0,
    mixed_share=0,
    hdr_gain=1000,
    finish=CLEAN,
)
"""Light and filters, but no error of depth."""


def capture(config: StructuredLightConfig, seed: int = 0, distance_mm: float = 600) -> CapturedView:
    """The toy motor from a place that depends on the seed."""
    view = anywhere(seed, distance_mm)
    return capture_view(CASTER, view, config, np.random.default_rng(seed))


def wall_depth(view: CapturedView, pose: Transform, tilt_deg: float) -> np.ndarray:
    """Exact depth of `slab(tilt_deg=...)` at every pixel."""
    rows, columns = np.indices(view.depth_mm.shape)
    rays = (
        np.stack([columns, rows, np.ones_like(rows)], axis=2) @ np.linalg.inv(view.camera_matrix).T
    )
    tilt = np.radians(tilt_deg)
    normal = np.array([0, -np.sin(tilt), np.cos(tilt)])
    return -(pose.translation_mm @ normal) / (pose.rotate(rays) @ normal)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), distance_mm=st.floats(300, 1500))
def test_without_noise_the_cloud_lies_on_the_mesh_with_its_labels(
    seed: int, distance_mm: float
) -> None:
    pose = anywhere(seed, distance_mm)
    config = CONFIG.noiseless()

    view = capture_view(CASTER, pose, config, np.random.default_rng(0))

    points = pose.apply(view.points())
    assert len(points) > 50
    chosen = np.random.default_rng(seed).integers(0, len(points), 300)
    distances = distance_to_solids(points[chosen], MOTOR)
    assert distances.min(axis=0).max() < 1e-3
    index = view.solid_index.reshape(-1)[view.pixels][chosen]
    labels = view.labels.reshape(-1)[view.pixels][chosen]
    # where two surfaces touch either is right: the pixel's own is as near as the nearest
    assert distances[index, np.arange(300)].max() < 1e-3
    np.testing.assert_array_equal(labels, [int(MOTOR[row].part) for row in index])


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_camera_and_projector_see_every_point(seed: int) -> None:
    pose = anywhere(seed)
    view = capture_view(CASTER, pose, CONFIG.noiseless(), np.random.default_rng(0))
    points = pose.apply(view.points())

    for station in ((0, 0, 0), (CONFIG.baseline_mm, 0, 0)):
        eye = pose.apply(station)[None]
        assert not CASTER.is_blocked(eye, points).any()


@pytest.mark.parametrize("tilt_deg", [0, 30, 50])
def test_a_wall_has_the_depth_of_its_plane(tilt_deg: float) -> None:
    pose = camera_at((0, 0, 600))
    view = capture_view(
        [slab(tilt_deg=tilt_deg)], pose, CONFIG.noiseless(), np.random.default_rng(0)
    )

    measured = view.depth_mm > 0
    assert measured.mean() > 0.8
    exact = wall_depth(view, pose, tilt_deg)
    np.testing.assert_allclose(view.depth_mm[measured], exact[measured], atol=1e-6)


def test_a_ball_has_the_depth_of_its_sphere() -> None:
    ball = as_solid(Manifold.sphere(60, 400))
    view = capture_view(
        [ball], camera_at((0, 0, 500)), CONFIG.noiseless(), np.random.default_rng(0)
    )

    radius = np.linalg.norm(camera_at((0, 0, 500)).apply(view.points()), axis=1)

    # the facets of an inscribed polyhedron lie inside, by at most their sagitta
    assert radius.max() < 60 + 1e-6
    assert radius.min() > 60 - 60 * (1 - np.cos(2 * np.pi / 400)) - 1e-6


def test_what_only_the_camera_sees_is_absent() -> None:
    """A post on a wall throws the projector's shadow to its other side, of known width."""
    pose = camera_at((0, 0, 600))
    axis = pose.rotation[:, 0]
    across = (20, 600) if abs(axis[0]) > 0.5 else (600, 20)
    post = as_solid(box((*across, 60), (0, 0, 30)))
    config = replace(CONFIG, baseline_mm=150.0).noiseless()
    view = capture_view([slab(), post], pose, config, np.random.default_rng(0))
    points = pose.apply(view.points())
    along = points @ axis
    on_wall = np.abs(points[:, 2]) < 1e-3
    pixel_mm = 600 / SMALL.focal_px

    # the ray from the lamp over the top edge of the post meets the wall here
    shadow_end = -10 - 60 * (150 + 10) / (600 - 60)
    behind = along[on_wall & (along < 0)].max()
    assert shadow_end - pixel_mm < behind < shadow_end + 1e-6
    # on the lamp's side the post hides nothing but what it stands on and the camera cannot see
    before = along[on_wall & (along > 0)].min()
    assert 10 - 1e-6 < before < 10 + 60 * 10 / (600 - 60) + pixel_mm


def test_switched_off_errors_leave_the_exact_depth() -> None:
    view = capture_view([slab()], camera_at((0, 0, 600)), QUIET, np.random.default_rng(0))

    measured = view.depth_mm > 0
    assert measured.mean() > 0.9
    np.testing.assert_allclose(view.depth_mm[measured], 600, atol=1e-4)


def test_noise_at_normal_incidence_is_the_quoted_one() -> None:
    for noise_mm, smoothing in ((0.05, 1.0), (0.05, 0.0), (0.2, 0.6)):
        config = replace(QUIET, noise_mm=noise_mm, smoothing=smoothing, noise_incidence=0)
        view = capture_view([slab()], camera_at((0, 0, 600)), config, np.random.default_rng(0))
        inner = view.depth_mm[50:-50, 60:-60]
        assert (inner > 0).mean() > 0.99
        assert inner[inner > 0].std() == pytest.approx(noise_mm, rel=0.05)


def test_noise_grows_with_distance_incidence_and_darkness() -> None:
    def sigma(config: StructuredLightConfig, distance_mm: float, tilt_deg: float = 0) -> float:
        pose = camera_at((0, 0, distance_mm))
        wall = [slab(tilt_deg=tilt_deg)]
        view = capture_view(wall, pose, config, np.random.default_rng(0))
        middle = (slice(30, -30), slice(50, -50))
        error = (view.depth_mm - wall_depth(view, pose, tilt_deg))[middle]
        return float(error[view.depth_mm[middle] > 0].std())

    config = replace(QUIET, camera=NARROW, noise_mm=0.02, noise_incidence=0.15)
    base = sigma(config, 600)
    assert sigma(config, 1200) == pytest.approx(4 * base, rel=0.05)
    assert sigma(config, 600, 60) == pytest.approx((1 + 0.15 * 3) * base, rel=0.1)
    # light back from grey plastic: matt part and, for lamp and eye along the normal, highlight
    light = 0.28 + 0.04 / (4 * 0.30**2)
    dark = replace(config, hdr_gain=1.0, baseline_mm=1.0)
    expected = np.sqrt(0.3 + 0.4 / light + 0.3 / light**2)
    assert sigma(dark, 600) == pytest.approx(expected * base, rel=0.1)


def test_scale_error_and_bias_are_recovered() -> None:
    config = replace(QUIET, noise_mm=0.03)
    exact = capture(config.noiseless())
    for scale, bias in ((0.002, 0.0), (-0.001, 0.0), (0.0, 0.3)):
        view = capture(replace(config, scale_error=scale, bias_mm=bias))
        both = (view.depth_mm > 0) & (exact.depth_mm > 0)
        ratio = np.median(view.depth_mm[both] / exact.depth_mm[both]) - 1
        assert ratio == pytest.approx(scale + bias / np.median(exact.depth_mm[both]), abs=5e-5)


def test_smooth_errors_are_smooth_and_of_their_size() -> None:
    for name, size_mm, low, high in (
        ("ripple_mm", 0.1, 0.5, 1.0),
        ("lumps_mm", 0.1, 0.7, 1.3),
        ("warp_mm", 0.1, 0.1, 1.0),
    ):
        config = replace(QUIET, **{name: size_mm}, ripple_period_mm=60, lumps_size_mm=40)
        pose = camera_at((0, 0, 600))
        view = capture_view([slab()], pose, config, np.random.default_rng(0))
        error = view.depth_mm - 600
        inner = (view.depth_mm > 0)[:, 1:] & (view.depth_mm > 0)[:, :-1]
        assert low * size_mm < error[view.depth_mm > 0].std() < high * size_mm, name
        steps = np.diff(error, axis=1)[inner]
        assert np.abs(steps).max() < 0.8 * size_mm, name


def test_dark_and_mirroring_surfaces_lose_points() -> None:
    def kept(material: Material, tilt_deg: float) -> float:
        view = capture_view(
            [slab(material, tilt_deg=tilt_deg)],
            camera_at((0, 0, 600)),
            replace(CONFIG, finish=CLEAN, min_signal=0.03, saturation_signal=1.2),
            np.random.default_rng(0),
        )
        return float((view.depth_mm > 0).mean())

    assert kept(Material.GREY_PLASTIC, 0) > 0.95
    assert kept(Material.BLACK_PLASTIC, 60) < 0.5
    # the mirror direction of the projector is near the normal
    assert kept(Material.ZINC, 0) < 0.9 * kept(Material.ZINC, 40)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_sampled_camera_gives_consistent_views_again_and_again(seed: int) -> None:
    config = sample_structured_light(np.random.default_rng(seed), SMALL)

    first, second = capture(config, seed), capture(config, seed)

    for name in ("depth_mm", "labels", "solid_index", "camera_matrix"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    measured = first.depth_mm > 0
    assert np.isfinite(first.depth_mm).all()
    np.testing.assert_array_equal(measured, first.solid_index >= 0)
    assert (first.labels[~measured] == 0).all()
    assert len(first.points()) == measured.sum() > 50
    exact = capture(config.noiseless(), seed)
    assert (exact.depth_mm[measured] > 0).all()
    error = np.abs(first.depth_mm - exact.depth_mm)[measured]
    assert np.median(error) < 1.5
    assert first.depth_mm.dtype == np.float64
    assert first.labels.dtype == np.uint8
    assert first.solid_index.dtype == np.int32


def test_threads_of_linear_algebra_change_no_bits() -> None:
    views: list[CapturedView] = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            views.append(capture(CONFIG, 4))
    np.testing.assert_array_equal(views[0].depth_mm, views[1].depth_mm)


def test_another_seed_gives_other_errors() -> None:
    pose = anywhere(0)
    one, two = (capture_view(CASTER, pose, CONFIG, np.random.default_rng(seed)) for seed in (1, 2))
    assert (one.depth_mm != two.depth_mm).any()


def test_solids_or_a_ray_caster_make_the_same_view() -> None:
    pose = anywhere(3)
    one = capture_view(MOTOR, pose, CONFIG, np.random.default_rng(0))
    two = capture_view(CASTER, pose, CONFIG, np.random.default_rng(0))
    np.testing.assert_array_equal(one.depth_mm, two.depth_mm)


def test_a_camera_that_looks_away_sees_nothing() -> None:
    pose = camera_at((0, 0, 600))
    away = replace(pose, matrix=pose.matrix @ np.diag([1.0, -1, -1, 1]))
    for config in (CONFIG, CONFIG.noiseless()):
        view = capture_view(CASTER, away, config, np.random.default_rng(0))
        assert view.points().shape == (0, 3)
