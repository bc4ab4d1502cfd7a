"""The layer of the scan: every browser gets the points that its own view needs."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from boltpose.arrays import FloatArray, IntArray, UInt8Array
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.detail import COARSE, FINE, MIDDLE, Detail, Sight, cut, wanted_levels
from boltpose.viewer.page import Page
from boltpose.viewer.pick import PickLayer
from boltpose.viewer.points import POINT_WIDTH
from boltpose.viewer.web import viser

_LOG = logging.getLogger(__name__)
_STILL_S = 0.25
"""A view that has not turned for so long stands still."""
_PORTION = 200_000
"""So many points are sent before the view is looked at again."""

_QUICK_S = 0.12
"""A browser that answers sooner can draw more points; with a graphics card it is 0.02 s."""
_QUESTIONS = 5
"""To a browser, before it gets more."""
_TRIES = 4
"""A browser that has just opened the page is slow for another reason: it is asked again."""

ColorOf = Callable[[IntArray], UInt8Array]
"""Colours, shape (K, 3), of rows of the scan, shape (K,)."""


@dataclass(frozen=True, slots=True, eq=False)
class _Content:
    """What is shown; another scan is another object."""

    points: FloatArray
    detail: Detail


@dataclass(slots=True, eq=False)
class _Viewer:
    """One browser."""

    client: viser.ClientHandle
    content: _Content | None = None
    color_of: ColorOf | None = None
    nodes: dict[tuple[int, int], viser.PointCloudHandle | None] = field(default_factory=dict)
    """By tile and level: what this browser has; None where there is no point to send."""
    levels: list[int] = field(default_factory=list)
    """By tile: what it draws."""
    moved: float = -1e9
    """When its view turned last, seconds of the monotonic clock."""
    sent_bytes: int = 0
    """Of points and colours."""
    cap: int = FINE
    """The finest level that this computer draws quickly, as far as is known."""
    is_fresh: bool = False
    """True while nobody knows yet how it copes with what it was sent last."""
    tries: int = 0


class ScanLayer:
    """The points of one scan in every browser, as fine as its view needs.

    A thread of its own sends points, so that the page stays quick. Points that are there already
    are hidden while the view turns, if there are many.
    """

    def __init__(self, page: Page, name: str = "scan") -> None:
        """An empty layer."""
        self._page = page
        self._name = name
        self._config: ViewerConfig = page.config
        self._root = page.server.scene.add_frame(f"/{name}", show_axes=False)
        self._viewers: dict[int, _Viewer] = {}
        self._content: _Content | None = None
        self._color_of: ColorOf | None = None
        self._change = threading.Condition()
        self._version = 0
        self._is_stopped = False
        self._is_light = False
        self._idle = threading.Event()
        self._pick: PickLayer | None = None
        self._thread = threading.Thread(target=self._run, name="scan-layer", daemon=True)
        page.server.on_client_connect(self._connect)
        page.server.on_client_disconnect(self._disconnect)
        page.at_stop(self._stop)
        self._thread.start()

    def show(self, points: FloatArray, color_of: ColorOf) -> None:
        """Show a scan instead of the one before.

        Args:
            points: Shape (N, 3), mm, frame of the page.
            color_of: Called on the layer's thread, for the rows that are sent.
        """
        content = _Content(points, cut(points, self._config))
        spacing_mm = content.detail.spacing_mm[FINE]
        self._pick = PickLayer(name=self._name, points=points, spacing_mm=2 * spacing_mm)
        self._page.make_pickable(self._pick)
        self._wake(content, color_of)

    def recolor(self, color_of: ColorOf) -> None:
        """Give the scan that is shown other colours; the points are not sent again."""
        self._wake(self._content, color_of)

    def clear(self) -> None:
        """Show nothing; returns when every browser was told so."""
        self._page.forget_pickable(self._name)
        self._pick = None
        self._idle.clear()
        self._wake(None, None)
        self._idle.wait(5.0)

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide the scan."""
        self._root.visible = is_visible
        if self._pick is not None:
            self._pick.is_shown = is_visible

    def set_light(self, is_light: bool) -> None:
        """Draw the coarse points only, for a computer without a graphics card."""
        with self._change:
            self._is_light = is_light
            self._notify()

    @property
    def sent_bytes(self) -> int:
        """Bytes of points and colours that the browsers open now were sent."""
        return sum(viewer.sent_bytes for viewer in self._viewers.values())

    def _wake(self, content: _Content | None, color_of: ColorOf | None) -> None:
        with self._change:
            self._content, self._color_of = content, color_of
            self._idle.clear()
            self._notify()

    def _notify(self) -> None:
        self._version += 1
        self._change.notify_all()

    def _connect(self, client: viser.ClientHandle) -> None:
        viewer = _Viewer(client)

        async def moved(_: viser.CameraHandle) -> None:
            with self._change:
                viewer.moved = time.monotonic()
                self._notify()

        client.camera.on_update(moved)
        with self._change:
            self._viewers[client.client_id] = viewer
            self._notify()

    def _disconnect(self, client: viser.ClientHandle) -> None:
        with self._change:
            self._viewers.pop(client.client_id, None)

    def _stop(self) -> None:
        with self._change:
            self._is_stopped = True
            self._notify()
        self._thread.join(timeout=10.0)

    def _run(self) -> None:
        while True:
            with self._change:
                if self._is_stopped:
                    return
                viewers = list(self._viewers.values())
                content, color_of = self._content, self._color_of
                version = self._version
            due: list[float] = []
            for viewer in viewers:
                try:
                    due.append(self._bring_up(viewer, content, color_of))
                except Exception:  # noqa: BLE001 - a browser that has gone must not stop the others
                    _LOG.debug("a browser was not served", exc_info=True)
            wait = min(due, default=60.0)
            with self._change:
                if self._is_stopped:
                    return
                # whatever changed meanwhile is looked at before anyone sleeps
                if version == self._version and wait > 0:
                    self._idle.set()
                    self._change.wait(wait)

    def _bring_up(
        self, viewer: _Viewer, content: _Content | None, color_of: ColorOf | None
    ) -> float:
        """Bring one browser nearer to what it should show; returns when to look again, seconds."""
        if viewer.content is not content:
            self._remove_all(viewer)
            viewer.content, viewer.color_of = content, color_of
            viewer.cap, viewer.is_fresh, viewer.tries = FINE, True, 0
        if content is None or color_of is None:
            return 60.0
        if viewer.color_of is not color_of:
            self._recolor(viewer, content, color_of)
            viewer.color_of = color_of
        tiles = range(len(content.detail.tiles))
        if any((tile, COARSE) not in viewer.nodes for tile in tiles):
            self._send(viewer, content, color_of, [(tile, COARSE) for tile in tiles])
            self._draw(viewer, content, [COARSE] * len(tiles))
            return 0.0
        still_in = viewer.moved + _STILL_S - time.monotonic()
        levels = wanted_levels(
            content.detail, _sight(viewer.client), self._config, is_moving=still_in > 0
        )
        cap = COARSE if self._is_light else viewer.cap
        levels = [min(level, cap) for level in levels]
        if still_in > 0:
            # only what is there already: nothing is sent while the view turns
            levels = [min(a, b) for a, b in zip(levels, _held(viewer, len(tiles)), strict=True)]
            self._draw(viewer, content, levels)
            return still_in
        if viewer.is_fresh and not self._is_light:
            again_in = self._judge(viewer, content)
            if again_in is not None:
                return again_in
        missing = [
            (tile, level)
            for level in (MIDDLE, FINE)
            for tile, wanted in enumerate(levels)
            if wanted >= level and (tile, level) not in viewer.nodes
        ]
        portion = _portion(content.detail, missing)
        self._forget_fine(viewer, content, levels)
        self._send(viewer, content, color_of, portion)
        held = _held(viewer, len(tiles))
        self._draw(viewer, content, [min(a, b) for a, b in zip(levels, held, strict=True)])
        viewer.is_fresh = viewer.is_fresh or bool(portion)
        return 0.0 if portion else 60.0

    def _judge(self, viewer: _Viewer, content: _Content) -> float | None:
        """See how quickly a browser answers; if slowly, let it draw less.

        Returns:
            When to look again, seconds; None if it may have more.
        """
        if _delay_s(viewer.client) < _QUICK_S:
            viewer.is_fresh = False
            return None
        drawn = max(viewer.levels, default=COARSE)
        if drawn > COARSE:
            viewer.cap = drawn - 1
            self._draw(viewer, content, [min(level, viewer.cap) for level in viewer.levels])
            return 0.5
        viewer.tries += 1
        if viewer.tries < _TRIES:
            return 1.0
        viewer.cap, viewer.is_fresh = COARSE, False
        return 60.0

    def _send(
        self,
        viewer: _Viewer,
        content: _Content,
        color_of: ColorOf,
        keys: list[tuple[int, int]],
    ) -> None:
        rows = [content.detail.tiles[tile].rows[level] for tile, level in keys]
        if not rows:
            return
        colors = color_of(np.concatenate(rows))
        start = 0
        with viewer.client.atomic():
            for (tile, level), part in zip(keys, rows, strict=True):
                if len(part) == 0:
                    viewer.nodes[tile, level] = None
                    continue
                # half floats about the tile's own middle: the finest a screen can show
                centre = content.detail.tiles[tile].centre_mm
                viewer.nodes[tile, level] = viewer.client.scene.add_point_cloud(
                    f"/{self._name}/{tile}/{level}",
                    points=content.points[part] - centre,
                    colors=colors[start : start + len(part)],
                    point_size=POINT_WIDTH * content.detail.spacing_mm[level],
                    point_shape="circle",
                    point_shading="flat",
                    position=centre,
                )
                start += len(part)
        viewer.sent_bytes += 9 * start

    def _draw(self, viewer: _Viewer, content: _Content, levels: list[int]) -> None:
        """Show every tile at a level that the browser has."""
        if levels == viewer.levels:
            return
        with viewer.client.atomic():
            for (tile, level), node in viewer.nodes.items():
                if node is None:
                    continue
                is_shown = level <= levels[tile]
                if node.visible != is_shown:
                    node.visible = is_shown
                size = POINT_WIDTH * content.detail.spacing_mm[levels[tile]]
                if is_shown and node.point_size != size:
                    node.point_size = size
        viewer.levels = levels

    def _recolor(self, viewer: _Viewer, content: _Content, color_of: ColorOf) -> None:
        for tile, level in sorted(viewer.nodes, key=lambda key: key[1]):
            rows, node = content.detail.tiles[tile].rows[level], viewer.nodes[tile, level]
            if node is not None:
                node.colors = color_of(rows)
                viewer.sent_bytes += 3 * len(rows)

    def _forget_fine(self, viewer: _Viewer, content: _Content, levels: list[int]) -> None:
        """Take fine points back that are not looked at, when a browser has more than its budget."""
        detail = content.detail
        held = sum(len(detail.tiles[tile].rows[level]) for tile, level in viewer.nodes)
        for tile, level in list(viewer.nodes):
            if held <= self._config.still_points:
                return
            if level == FINE and levels[tile] < FINE:
                held -= len(detail.tiles[tile].rows[level])
                node = viewer.nodes.pop((tile, level))
                if node is not None:
                    node.remove()

    def _remove_all(self, viewer: _Viewer) -> None:
        with viewer.client.atomic():
            for node in viewer.nodes.values():
                if node is not None:
                    node.remove()
        viewer.nodes, viewer.levels = {}, []


def _delay_s(client: viser.ClientHandle) -> float:
    """How long a browser takes to answer, between two pictures, seconds: the median of a few.

    The shortest would not do: a question that comes just before a picture is done is answered at
    once, however long pictures take.
    """
    delays: list[float] = []
    for _ in range(_QUESTIONS):
        start = time.monotonic()
        # a browser that keeps no storage answers too, and one that has gone needs no points
        with contextlib.suppress(TimeoutError, RuntimeError):
            client.local_storage.get_item("boltpose", timeout=5 * _QUICK_S)
        delays.append(time.monotonic() - start)
    return float(np.median(delays))


def _held(viewer: _Viewer, count: int) -> list[int]:
    """By tile: the finest level that the browser has, with all coarser ones."""
    return [
        next((step - 1 for step in (MIDDLE, FINE) if (tile, step) not in viewer.nodes), FINE)
        for tile in range(count)
    ]


def _portion(detail: Detail, keys: list[tuple[int, int]]) -> list[tuple[int, int]]:
    count = np.cumsum([len(detail.tiles[tile].rows[level]) for tile, level in keys])
    return keys[: max(1, int(np.searchsorted(count, _PORTION)))] if keys else []


def _sight(client: viser.ClientHandle) -> Sight:
    camera = client.camera
    forward = camera.look_at - camera.position
    tangent = float(np.tan(camera.fov / 2))
    return Sight(
        position_mm=np.array(camera.position),
        forward=forward / max(float(np.linalg.norm(forward)), 1e-9),
        half_angle_rad=float(np.arctan(tangent * np.hypot(1.0, camera.aspect))),
        pixels_per_rad=camera.image_height / 2 / tangent,
    )
