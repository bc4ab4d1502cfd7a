"""What a clamp stands on: base plates with T-slots or grids of holes, and the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.factory.clamps.assembly import ClampBody
from boltpose.factory.clamps.fasteners import any_screw, bevelled_box
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, union


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ground:
    """Base plate and table; the plate's top is z = 0."""

    bodies: tuple[ClampBody, ...]
    plate_half_mm: tuple[float, float]
    """Half its length along x and y."""
    table_mm: float
    """z of the table's top, below 0."""


def make_ground(rng: np.random.Generator, half_x_mm: float, half_y_mm: float) -> Ground:
    """Base plate and table under a clamp that needs at least this much room."""
    half_x = half_x_mm + float(rng.uniform(10, 90))
    half_y = half_y_mm + float(rng.uniform(10, 90))
    thick = float(rng.uniform(10, 40))
    style = int(rng.integers(4))
    if style == 0:
        thick = max(thick, 24.0)
        plate, material = _slotted(rng, half_x, half_y, thick), Material.CAST_IRON
    elif style == 1:
        plate, material = _holed(rng, half_x, half_y, thick), Material.BARE_STEEL
    elif style == 2:
        plate, material = _holed(rng, half_x, half_y, thick), Material.CAST_ALUMINIUM
    else:
        plate = bevelled_box((2 * half_x, 2 * half_y, thick), 1).translate((0, 0, -thick / 2))
        material = Material.WOOD if rng.random() < 0.4 else Material.PAINTED_STEEL
    bodies = [ClampBody(name="base_plate", body=plate, material=material)]
    screws: list[Manifold] = []
    if rng.random() < 0.7:
        size = int(rng.choice([8, 10, 12]))
        inset = 2.2 * size
        screws = [
            any_screw(rng, size).translate((sx * (half_x - inset), sy * (half_y - inset), 0))
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
        bodies.append(ClampBody(name="base_screws", body=union(screws), material=Material.ZINC))
    table_half = float(rng.uniform(600, 900))
    table = box((2 * table_half, 2 * table_half, 30), (0, 0, -thick - 15))
    wood = rng.random() < 0.4
    bodies.append(
        ClampBody(
            name="table", body=table, material=Material.WOOD if wood else Material.PAINTED_STEEL
        )
    )
    return Ground(bodies=tuple(bodies), plate_half_mm=(half_x, half_y), table_mm=-thick)


def _slotted(rng: np.random.Generator, half_x: float, half_y: float, thick: float) -> Manifold:
    """A plate with T-slots along x."""
    pitch = float(rng.uniform(40, 75))
    neck = float(rng.choice([10, 12, 14, 18]))
    count = max(1, int(2 * half_y / pitch))
    first = -0.5 * (count - 1) * pitch
    plate = box((2 * half_x, 2 * half_y, thick), (0, 0, -thick / 2))
    slots: list[Manifold] = []
    for index in range(count):
        y = first + index * pitch
        slots.append(box((2 * half_x + 2, neck, 0.6 * thick), (0, y, 0)))
        slots.append(box((2 * half_x + 2, 1.8 * neck, 0.3 * thick), (0, y, -0.45 * thick)))
    return plate - union(slots)


def _holed(rng: np.random.Generator, half_x: float, half_y: float, thick: float) -> Manifold:
    """A plate with a grid of holes."""
    pitch = float(rng.choice([40, 50, 60]))
    radius = float(rng.choice([4, 5, 6, 8]))
    columns = int((2 * half_x - 30) / pitch) + 1
    rows = int((2 * half_y - 30) / pitch) + 1
    hole = cylinder(radius, -min(thick - 3, 20), 1)
    holes = [
        hole.translate(((i - (columns - 1) / 2) * pitch, (j - (rows - 1) / 2) * pitch, 0))
        for i in range(columns)
        for j in range(rows)
    ]
    plate = bevelled_box((2 * half_x, 2 * half_y, thick), 1).translate((0, 0, -thick / 2))
    return plate - union(holes)
