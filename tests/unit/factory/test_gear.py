from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.factory.gear import build_gear, tooth_outline, tooth_radii
from boltpose.factory.solids import Manifold, mesh_arrays
from boltpose.factory.spec import GearSpec
from tests.unit.factory.small_motor import is_closed


def front_of(spec: GearSpec) -> float:
    return spec.gap_mm + spec.clutch_length_mm + spec.width_mm


def section_area(body: Manifold, z: float) -> float:
    return body.slice(z).area()


@given(
    teeth=st.integers(7, 16),
    module_mm=st.floats(1.5, 4.5, exclude_min=True, exclude_max=True),
    gap_mm=st.floats(0, 40),
    shaft_radius_mm=st.floats(2.6, 15),
    wall_mm=st.floats(1.5, 25),
    stop_ring=st.booleans(),
    free_mm=st.floats(0, 40),
)
@settings(max_examples=40, deadline=None)
def test_every_pinion_is_one_closed_body_within_its_radii(
    teeth: int,
    module_mm: float,
    gap_mm: float,
    shaft_radius_mm: float,
    wall_mm: float,
    stop_ring: bool,
    free_mm: float,
) -> None:
    spec = GearSpec(
        teeth=teeth,
        module_mm=module_mm,
        gap_mm=gap_mm,
        shaft_radius_mm=shaft_radius_mm,
        clutch_radius_mm=max(5.1, shaft_radius_mm + wall_mm),
        stop_ring=stop_ring,
    )
    tip_z = front_of(spec) + free_mm
    gear = build_gear(spec, shaft_front_mm=tip_z, shaft_rear_mm=-3)
    vertices, faces = mesh_arrays(gear.body)
    assert is_closed(faces)
    assert len(gear.body.decompose()) == 1
    assert np.hypot(vertices[:, 0], vertices[:, 1]).max() <= gear.largest_radius_mm + 0.02
    assert (vertices[:, 2].min(), vertices[:, 2].max()) == pytest.approx((-3, tip_z))


@pytest.mark.parametrize("teeth", [7, 9, 11, 16])
def test_teeth_repeat_around_the_axis(teeth: int) -> None:
    outline = tooth_outline(GearSpec(teeth=teeth))
    turn = 2 * math.pi / teeth
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    per_tooth = len(outline) // teeth
    np.testing.assert_allclose(
        outline @ rotation.T, np.roll(outline, -per_tooth, axis=0), atol=1e-9
    )


def test_a_tooth_is_as_thick_at_the_pitch_circle_as_its_shift_says() -> None:
    spec = GearSpec(teeth=12, module_mm=2.5)
    gear = build_gear(spec, shaft_front_mm=front_of(spec))
    middle = 0.5 * sum(gear.pinion_z_mm)
    section = gear.body.slice(middle)
    root, tip = tooth_radii(spec)
    pitch = 15.0
    angles = np.linspace(0, 2 * math.pi, 7200, endpoint=False)
    ring = [(pitch * math.cos(a), pitch * math.sin(a)) for a in angles.tolist()]
    is_metal = [section_area_at(section, point) for point in ring]
    thickness = math.pi / 2 + 2 * 0.35 * math.tan(math.radians(20))
    assert np.mean(is_metal) == pytest.approx(thickness / math.pi, abs=0.01)
    assert root < pitch < tip


def section_area_at(section: object, point: tuple[float, float]) -> bool:
    """Whether a point of the plane is in a cross-section (even-odd rule)."""
    crossings = 0
    for polygon in section.to_polygons():  # pyright: ignore[reportAttributeAccessIssue]
        x, y = np.asarray(polygon).T
        x2, y2 = np.roll(x, -1), np.roll(y, -1)
        straddles = (y > point[1]) != (y2 > point[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = x + (point[1] - y) / (y2 - y) * (x2 - x)
        crossings += int((straddles & (at > point[0])).sum())
    return crossings % 2 == 1


def test_a_shaft_that_ends_before_its_pinion_is_refused() -> None:
    with pytest.raises(ConfigError, match="the shaft ends at 10 mm, its pinion at 35 mm"):
        build_gear(GearSpec(), shaft_front_mm=10)


def test_a_clutch_inside_its_shaft_is_refused() -> None:
    spec = GearSpec(clutch_radius_mm=6.5, shaft_radius_mm=6)
    with pytest.raises(ConfigError, match=r"clutch_radius_mm must be at least 7\.5 .* got 6\.5"):
        build_gear(spec, shaft_front_mm=60)
