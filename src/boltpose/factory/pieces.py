"""What the modules of a motor's bodies hand to `build`."""

from __future__ import annotations

from dataclasses import dataclass

from boltpose.factory.model import Material
from boltpose.factory.sites import Body
from boltpose.factory.solids import Manifold
from boltpose.schema import Part


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Piece:
    """One solid in the making, frame `build`."""

    name: str
    part: Part
    material: Material
    shape: Manifold
    body: Body | None = None
    """Which body's lugs and distractors it takes; None for what nothing sits on."""
    in_one_piece: bool = True
    """Crumbs that cuts leave beside its largest piece are dropped."""
