"""What carries a sloping fixture, and how a fixture is put over the origin."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.clamps.assembly import Assembly, ClampBody, frame_matrix
from boltpose.factory.clamps.fasteners import bevelled_box, hex_screw
from boltpose.factory.model import Material
from boltpose.factory.solids import prism, union
from boltpose.geometry.transforms import Transform


def wedge_bodies(
    rng: np.random.Generator,
    tilt: FloatArray,
    x_mm: tuple[float, float],
    wide_mm: float,
    *,
    closed: bool,
) -> list[ClampBody]:
    """What carries a slope: a closed wedge, or two cheeks with a plate under them.

    Args:
        rng: Source of thicknesses.
        tilt: Shape (4, 4); takes the level fixture, whose underside is z = 0, to its slope.
        x_mm: Where the level fixture begins and ends; the second end is the lower one.
        wide_mm: Its width along y.
        closed: A full wedge instead of two cheeks.
    """
    upper = tilt[:3, :3] @ (x_mm[0], 0, 0) + tilt[:3, 3]
    lower = tilt[:3, :3] @ (x_mm[1], 0, 0) + tilt[:3, 3]
    outline = [(lower[0], 0.0), (lower[0], lower[2]), (upper[0], upper[2]), (upper[0], 0.0)]
    if closed:
        body = prism(outline, -wide_mm * 0.45, wide_mm * 0.45).rotate((90, 0, 0))
        body = body.translate((0, float(tilt[1, 3]), 0))
        return [ClampBody(name="wedge", body=body, material=Material.PAINTED_STEEL, give_mm=0.05)]
    thick = float(rng.uniform(8, 16))
    pieces: list[ClampBody] = []
    middle = float(tilt[1, 3])
    for index, y in enumerate((-wide_mm / 2 + thick / 2, wide_mm / 2 - thick / 2)):
        body = prism(outline, -thick / 2, thick / 2).rotate((90, 0, 0))
        body = body.translate((0, middle + y, 0))
        pieces.append(
            ClampBody(
                name=f"cheek_{index}", body=body, material=Material.PAINTED_STEEL, give_mm=0.05
            )
        )
    long = lower[0] - upper[0]
    sheet = bevelled_box((long + 10, wide_mm + 40, 10), 1, (0.5 * (lower[0] + upper[0]), middle, 5))
    pieces.append(
        ClampBody(name="wedge_foot", body=sheet, material=Material.PAINTED_STEEL, give_mm=0.05)
    )
    heads = [
        hex_screw(10).translate((x, middle + y, 10))
        for x in (upper[0] + 14, lower[0] - 14)
        for y in (-wide_mm / 2 - 8, wide_mm / 2 + 8)
    ]
    pieces.append(
        ClampBody(name="wedge_screws", body=union(heads), material=Material.ZINC, give_mm=0.05)
    )
    return pieces


def centred(assembly: Assembly) -> Assembly:
    """The same with its middle over the origin."""
    boxes = np.array([np.asarray(piece.body.bounding_box()) for piece in assembly.bodies])
    middle = 0.5 * (boxes[:, :3].min(axis=0) + boxes[:, 3:].max(axis=0))
    shift = frame_matrix((1, 0, 0), (0, 1, 0), (-middle[0], -middle[1], 0))
    return assembly.moved(Transform("table", "table", shift))
