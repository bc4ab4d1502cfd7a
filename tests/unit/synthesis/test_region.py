from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.factory.model import Material, SceneModel, SolidPart
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.structured_light import CapturedView
from boltpose.synthesis.region import Region, draw_region

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
FACES = np.array([(0, 1, 2), (1, 3, 2), (4, 6, 5), (5, 6, 7)])


def _solid(name: str, part: Part, half: tuple[float, float, float], z: float) -> SolidPart:
    return SolidPart(
        name=name,
        part=part,
        material=Material.ZINC,
        vertices=CUBE * half + (0, 0, z),
        faces=FACES,
    )


SCENE = SceneModel(
    clamp_name="vice",
    solids=(
        _solid("table", Part.BACKGROUND, (900, 900, 5), -45),
        _solid("main_housing", Part.MAIN_HOUSING, (100, 40, 40), 80),
    ),
    table_from_motor=Transform.identity("table", "motor"),
)


def test_regions_never_cut_the_motor_and_half_of_the_views_have_none() -> None:
    motor = SCENE.solids[1].vertices
    drawn = [draw_region(SCENE, np.random.default_rng(seed)) for seed in range(400)]
    regions = [region for region in drawn if region is not None]
    assert 160 < len(regions) < 240
    for region in regions:
        assert (region.low < motor.min(axis=0)).all()
        assert (region.high > motor.max(axis=0)).all()
    assert 0.05 < np.mean([region.low[2] > 0 for region in regions]) < 0.3


def test_a_cut_keeps_exactly_what_lies_inside() -> None:
    rng = np.random.default_rng(3)
    depth = rng.uniform(400, 600, (40, 50))
    depth[:5] = 0
    captured = CapturedView(
        depth_mm=depth,
        labels=np.where(depth > 500, 1, 0).astype(np.uint8),
        solid_index=np.where(depth > 0, 2, -1).astype(np.int32),
        camera_matrix=np.array([(100.0, 0, 25), (0, 100.0, 20), (0, 0, 1)]),
    )
    turn = Rotation.from_euler("xyz", [3.0, 0.2, 0.4]).as_matrix()
    table_from_camera = Transform.from_parts("table", "camera", turn, (0, 0, 500))
    region = Region(low=np.array((-60.0, -60.0, -30.0)), high=np.array((60.0, 60.0, np.inf)))

    cut = region.cut(captured, table_from_camera)

    before = table_from_camera.apply(captured.points())
    inside = ((before >= region.low) & (before <= region.high)).all(axis=1)
    assert 0 < inside.sum() < len(before)
    np.testing.assert_array_equal(cut.points(), captured.points()[inside])
    np.testing.assert_array_equal(cut.pixels, captured.pixels[inside])
    gone = (captured.depth_mm > 0) & (cut.depth_mm == 0)
    assert (cut.labels[gone] == 0).all()
    assert (cut.solid_index[gone] == -1).all()
