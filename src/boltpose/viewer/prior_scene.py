"""A prior in the page: its surface in the colours of its parts, and every bolt that was found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from boltpose.geometry.transforms import Transform
from boltpose.picture.bolt_marks import Ink
from boltpose.picture.paint import part_tints
from boltpose.schema import Prior, PriorBolt
from boltpose.viewer.bolts import BoltLayer, BoltMark3d
from boltpose.viewer.page import Page
from boltpose.viewer.points import PointLayer, spacing_of
from boltpose.viewer.shade import light, lit_colors


class PriorScene:
    """Layers `prior` and `bolts` of a page whose frame is `prior`.

    Clicks: `page.on_surface_click` gives points of layer `prior` in frame `prior`,
    `scene.bolts.on_click` gives ids of bolts.
    """

    def __init__(self, page: Page) -> None:
        """Empty layers."""
        self.page = page
        self.surface = PointLayer(page, "prior")
        self.bolts = BoltLayer(page)
        self.prior: Prior | None = None
        """What is shown."""

    def show(self, prior: Prior, *, ink_of: Callable[[PriorBolt], Ink] | None = None) -> None:
        """Show a prior.

        Args:
            prior: The surface is sent again only if it is another one than before.
            ink_of: How each bolt is drawn; by default a sure one full, an unsure one as a ring.
        """
        if self.prior is None or prior.points is not self.prior.points:
            self._show_surface(prior)
        self.prior = prior
        draw = ink_of or _ink_by_sureness
        self.bolts.show([_mark(bolt, draw(bolt)) for bolt in prior.bolts])

    def look_from_above(self) -> None:
        """Put the viewer where most bolts can be seen: obliquely above the motor's axis."""
        if self.prior is None:
            return
        points = self.prior.points
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        radius = float(np.linalg.norm(points - middle, axis=1).max())
        motor = self.prior.alignment.prior_from_motor
        away = motor.rotate(np.array([[0.9, 0.75, 1.2]]))[0]
        away /= np.linalg.norm(away)
        self.page.look_at(middle, middle + 3.6 * radius * away, up=motor.rotation[:, 1])

    def _show_surface(self, prior: Prior) -> None:
        motor = prior.alignment.prior_from_motor
        away = motor.rotate(np.array([[0.9, 0.75, 1.2]]))[0]
        brightness = light(prior.normals, motor.rotation[:, 1], away / np.linalg.norm(away))
        self.surface.show(
            prior.points, lit_colors(part_tints(prior.labels), brightness), spacing_of(prior.points)
        )


def _ink_by_sureness(bolt: PriorBolt) -> Ink:
    return Ink.SEEN if bolt.is_sure else Ink.PARTIAL


def _mark(bolt: PriorBolt, ink: Ink) -> BoltMark3d:
    text = bolt.id if not bolt.name else f"{bolt.id} {bolt.name}"
    return BoltMark3d(
        id=bolt.id,
        text=text if bolt.is_sure else f"{text} ?",
        page_from_bolt=Transform("page", "bolt", bolt.prior_from_bolt.matrix),
        head_diameter_mm=bolt.head_diameter_mm,
        head_height_mm=bolt.head_height_mm,
        ink=ink,
    )
