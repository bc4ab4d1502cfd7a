"""The layer of bolts: marks, names and sigma ellipsoids that can be clicked on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.picture.bolt_marks import Ink
from boltpose.report.markup import Html
from boltpose.viewer.bolt_tips import BoltTips, Tip
from boltpose.viewer.glyphs import ARROW_MM, bolt_shape, ellipsoid_axes
from boltpose.viewer.page import Page
from boltpose.viewer.web import viser

CHOSEN = (0, 140, 255)
"""Colour of the bolt that was clicked on."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoltMark3d:
    """One bolt to show."""

    id: str
    text: str
    """What stands beside it."""
    page_from_bolt: Transform
    """From frame `bolt` to the frame of the page, whatever its name."""
    head_diameter_mm: float
    head_height_mm: float
    ink: Ink
    covariance_mm2: FloatArray | None = None
    """Shape (3, 3), of `head_top`, frame of the page; None draws no ellipsoid."""
    tip: Html | None = None
    """What its name tells when the mouse rests on it."""


@dataclass(slots=True, eq=False)
class _Drawn:
    mark: BoltMark3d
    mesh: viser.MeshHandle
    label: viser.LabelHandle
    ellipsoid: viser.IcosphereHandle | None


class BoltLayer:
    """All bolts of a page; the one that was clicked on is blue."""

    def __init__(self, page: Page, name: str = "bolts") -> None:
        """An empty layer.

        Args:
            page: Where it is shown.
            name: Of its nodes in the scene; one layer of a name per page.
        """
        self._page = page
        self._name = name
        self._root = page.server.scene.add_frame(f"/{name}", show_axes=False)
        self._drawn: dict[str, _Drawn] = {}
        self._then: list[Callable[[str], None]] = []
        self._tips = BoltTips(page)
        self._show_labels = True
        self._is_visible = True
        self._show_ellipsoids = False
        self._magnify = 20.0
        self.chosen: str | None = None
        """Id of the bolt that is marked."""

    def on_click(self, then: Callable[[str], None]) -> None:
        """Run something with the id of every bolt that is clicked on; it is marked already."""
        self._then.append(then)

    def show(self, marks: Sequence[BoltMark3d]) -> None:
        """Show these bolts and no others; the chosen one stays chosen if it is still there."""
        chosen = self.chosen
        with self._page.server.atomic():
            self.clear()
            for mark in marks:
                self._draw(mark)
            self._tell()
        if chosen in self._drawn:
            self.choose(chosen)

    def ids(self) -> tuple[str, ...]:
        """Of the bolts that are shown."""
        return tuple(self._drawn)

    def clear(self) -> None:
        """Show no bolt."""
        for drawn in self._drawn.values():
            drawn.mesh.remove()
            drawn.label.remove()
            if drawn.ellipsoid is not None:
                drawn.ellipsoid.remove()
        self._drawn = {}
        self.chosen = None
        self._tips.show(())

    def choose(self, bolt_id: str | None) -> None:
        """Mark one bolt, or none.

        Raises:
            KeyError: There is no bolt of that id.
        """
        wanted = None if bolt_id is None else self._drawn[bolt_id]
        if self.chosen is not None and self.chosen in self._drawn:
            old = self._drawn[self.chosen]
            old.mesh.color = rgb(old.mark.ink.color)
        if wanted is not None:
            wanted.mesh.color = CHOSEN
        self.chosen = bolt_id

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide all of the layer."""
        self._root.visible = self._is_visible = is_visible
        self._tips.set_visible(is_visible and self._show_labels)

    def set_labels(self, is_visible: bool) -> None:
        """Show or hide the names."""
        self._show_labels = is_visible
        self._tips.set_visible(is_visible and self._is_visible)
        for drawn in self._drawn.values():
            drawn.label.visible = is_visible

    def set_ellipsoids(self, is_visible: bool, magnify: float) -> None:
        """Show or hide the 1 sigma ellipsoids, this many times their true size."""
        self._show_ellipsoids, self._magnify = is_visible, magnify
        for drawn in self._drawn.values():
            if drawn.ellipsoid is not None and drawn.mark.covariance_mm2 is not None:
                drawn.ellipsoid.visible = is_visible
                axes, _ = ellipsoid_axes(drawn.mark.covariance_mm2)
                drawn.ellipsoid.scale = _three(axes * magnify)

    def _draw(self, mark: BoltMark3d) -> None:
        scene = self._page.server.scene
        shape = bolt_shape(mark.ink, mark.head_diameter_mm, mark.head_height_mm)
        name = f"/{self._name}/{len(self._drawn)}"
        mesh = scene.add_mesh_simple(
            f"{name}/mark",
            vertices=shape.vertices,
            faces=shape.faces,
            color=rgb(mark.ink.color),
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            wxyz=mark.page_from_bolt.quaternion_wxyz,
            position=mark.page_from_bolt.translation_mm,
        )
        label = scene.add_label(
            f"{name}/name",
            mark.text,
            position=_place_of_name(mark),
            anchor="bottom-center",
            visible=self._show_labels,
        )
        ellipsoid = None
        if mark.covariance_mm2 is not None:
            axes, directions = ellipsoid_axes(mark.covariance_mm2)
            ellipsoid = scene.add_icosphere(
                f"{name}/sigma",
                radius=1.0,
                color=(120, 60, 200),
                scale=_three(axes * self._magnify),
                opacity=0.55,
                cast_shadow=False,
                receive_shadow=False,
                wxyz=Rotation.from_matrix(directions).as_quat(scalar_first=True),
                position=mark.page_from_bolt.translation_mm,
                visible=self._show_ellipsoids,
            )
        self._page.on_node_click(mesh, lambda: self._clicked(mark.id))
        self._drawn[mark.id] = _Drawn(mark, mesh, label, ellipsoid)

    def _tell(self) -> None:
        marks = [drawn.mark for drawn in self._drawn.values()]
        self._tips.show(
            [
                Tip(
                    bolt_id=mark.id,
                    name=mark.text,
                    position_mm=_place_of_name(mark),
                    text=mark.tip,
                )
                for mark in marks
                if mark.tip is not None
            ]
        )

    def _clicked(self, bolt_id: str) -> None:
        if bolt_id not in self._drawn:
            return  # clicked on just before another result came
        self.choose(bolt_id)
        for then in self._then:
            then(bolt_id)


def _place_of_name(mark: BoltMark3d) -> FloatArray:
    """Beyond the arrow's tip; shape (3,), frame of the page."""
    reach = 6.0 if mark.ink is Ink.FORBIDDEN else ARROW_MM + 2.0
    return mark.page_from_bolt.apply(np.array([[0.0, 0.0, reach]]))[0]


def rgb(color: str) -> tuple[int, int, int]:
    """Read a colour written `#rrggbb`."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _three(values: FloatArray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
