"""What a bolt's name tells when the mouse rests on it, or a finger taps it.

viser tells of clicks, not of a mouse that rests. So an invisible piece of HTML lies over every
name, and the browser itself shows what is inside. Where the names are follows from its view.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.report.markup import Html, join, tag
from boltpose.viewer.page import Page
from boltpose.viewer.web import viser

_STILL_S = 0.25
"""Tips come back when a view has not turned for so long."""
_TIP_WIDTH = 0.5
"""Room that a tip wants to its right, in heights of the window."""
_LETTER_PX = 9
_LINE_PX = 26
"""Of the names that viser draws; a spot is a little larger than the name."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tip:
    """One name and what it tells."""

    bolt_id: str
    name: str
    """As it stands in the picture."""
    position_mm: FloatArray
    """Shape (3,), frame of the page: the name's lower edge, in the middle."""
    text: Html


@dataclass(slots=True, eq=False)
class _Viewer:
    client: viser.ClientHandle
    pane: viser.GuiHtmlHandle
    later: asyncio.TimerHandle | None = None


class BoltTips:
    """The tips of one page, in every browser where its names are."""

    def __init__(self, page: Page) -> None:
        """No tips yet."""
        # the page's thread brings new tips, viser's tells of views: never half of each
        self._lock = threading.Lock()
        self._tips: tuple[Tip, ...] = ()
        self._is_visible = True
        self._viewers: dict[int, _Viewer] = {}
        page.server.on_client_connect(self._connect)
        page.server.on_client_disconnect(self._disconnect)

    def show(self, tips: Sequence[Tip]) -> None:
        """Show these tips and no others."""
        with self._lock:
            self._tips = tuple(tips)
            self._lay_all()

    def set_visible(self, is_visible: bool) -> None:
        """Names that are hidden tell nothing."""
        with self._lock:
            self._is_visible = is_visible
            self._lay_all()

    async def _connect(self, client: viser.ClientHandle) -> None:
        viewer = _Viewer(client, client.gui.add_html(""))

        async def moved(_: viser.CameraHandle) -> None:
            # a spot where the name was is worse than none
            if viewer.later is None:
                viewer.pane.content = ""
            else:
                viewer.later.cancel()
            viewer.later = asyncio.get_running_loop().call_later(_STILL_S, stands, viewer)

        def stands(viewer: _Viewer) -> None:
            viewer.later = None
            with self._lock:
                self._lay(viewer)

        client.camera.on_update(moved)
        with self._lock:
            self._viewers[client.client_id] = viewer
            self._lay(viewer)

    async def _disconnect(self, client: viser.ClientHandle) -> None:
        with self._lock:
            viewer = self._viewers.pop(client.client_id, None)
        if viewer is not None and viewer.later is not None:
            viewer.later.cancel()

    def _lay_all(self) -> None:
        for viewer in self._viewers.values():
            self._lay(viewer)

    def _lay(self, viewer: _Viewer) -> None:
        tips = self._tips if self._is_visible else ()
        camera = viewer.client.camera
        turn = Rotation.from_quat(camera.wxyz, scalar_first=True).as_matrix()
        view = Transform.from_parts("page", "view", turn, camera.position)
        viewer.pane.content = str(lay_tips(tips, view, fov_rad=camera.fov, aspect=camera.aspect))


def lay_tips(
    tips: Sequence[Tip], page_from_view: Transform, *, fov_rad: float, aspect: float
) -> Html:
    """Lay a spot over every name that is in the picture.

    Args:
        tips: What there is to tell.
        page_from_view: Where the viewer stands; x right, y down, z ahead.
        fov_rad: Vertical angle of the picture.
        aspect: Width by height of the picture, which fills the height of the window.

    Returns:
        One element per name; places in parts of the window's height, whatever the screen's pixels.
    """
    if not tips:
        return join([])
    points = page_from_view.inverse().apply(np.array([tip.position_mm for tip in tips]))
    spots: list[Html] = []
    for tip, (x, y, ahead) in zip(tips, points, strict=True):
        if ahead <= 0:
            continue
        half = float(np.tan(fov_rad / 2))
        across, down = 0.5 * (aspect + x / ahead / half), 0.5 * (1.0 + y / ahead / half)
        if not (0 <= across <= aspect and 0 <= down <= 1):
            continue
        # beside the name, not over the bolt, and into the picture
        beside = "right" if aspect - across > _TIP_WIDTH else "left"
        side = f"{'up' if down > 0.5 else 'down'} {beside}"
        spots.append(
            tag(
                "div",
                tag("div", tip.text, class_="tip"),
                class_=f"bptip {side}",
                data_tip=tip.bolt_id,
                style=f"left:{100 * across:.2f}vh;top:{100 * down:.2f}vh;"
                f"width:{_LETTER_PX * len(tip.name) + 14}px;height:{_LINE_PX}px",
            )
        )
    return join(spots)
