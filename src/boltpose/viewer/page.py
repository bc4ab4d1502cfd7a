"""The page itself: server, panel with a headline and tabs, clicks, notes, and a clean stop."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.errors import BoltposeError
from boltpose.report.markup import Html
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.pick import PickLayer, pick_point
from boltpose.viewer.web import LOOPBACK, start_server, viser

_LOG = logging.getLogger(__name__)
_NOTE_COLORS: dict[str, tuple[int, int, int]] = {
    "info": (34, 102, 204),
    "good": (27, 127, 59),
    "error": (179, 0, 27),
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SurfaceClick:
    """Where somebody clicked on a cloud of points."""

    layer: str
    """Name of the layer, as given to `Page.make_pickable`."""
    point_mm: FloatArray
    """Shape (3,), frame of the page: the point of the cloud under the mouse."""
    row: int
    """Its row in the layer's points."""


def _backdrop() -> UInt8Array:
    """Light above, darker below; shape (256, 2, 3)."""
    top, bottom = np.array([250, 251, 253]), np.array([205, 214, 224])
    share = np.linspace(0, 1, 256)[:, None, None] ** 1.5
    image = (1 - share) * top + share * bottom
    return np.tile(np.round(image).astype(np.uint8), (1, 2, 1))


class HtmlPane:
    """A piece of the panel that shows HTML."""

    def __init__(self, gui: viser.GuiApi, order: float | None) -> None:
        """An empty one, where the panel is being built."""
        self._handle = gui.add_html("", order=order)

    def show(self, content: Html | None) -> None:
        """Show what `report.markup` has made instead of what is there; None shows nothing."""
        self.content = "" if content is None else content

    @property
    def content(self) -> str:
        """The HTML that is shown; who sets it has escaped whatever comes from a file."""
        return self._handle.content

    @content.setter
    def content(self, text: str) -> None:
        self._handle.content = str(text)  # viser sends no subclass of str


class Page:
    """One web page on this machine, and the thread on which its buttons do their work.

    What a callback does runs on one thread in the order it was asked for (`do`), so that no two
    of them change the page at once. Lengths are mm; the frame is that of the content.
    """

    def __init__(self, title: str, config: ViewerConfig | None = None) -> None:
        """Serve the page, empty yet.

        Args:
            title: On top of the panel, and said in the browser's tab.
            config: Settings.

        Raises:
            ConfigError: The port is taken.
        """
        self.config = config or ViewerConfig()
        self.server = start_server(self.config.port, title)
        self.url = f"http://{LOOPBACK}:{self.server.get_port()}"
        self.stopped = threading.Event()
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._pickable: list[PickLayer] = []
        self._surface_click: list[Callable[[SurfaceClick], None]] = []
        self._node_click: tuple[int, tuple[float, float]] | None = None
        self._at_stop: list[Callable[[], None]] = []
        self._set_up()
        self.headline = self.add_html(order=0)
        self._tabs = self.server.gui.add_tab_group(order=100)
        self._thread = threading.Thread(target=self._work_off, name="page", daemon=True)
        self._thread.start()

    def _set_up(self) -> None:
        server = self.server
        server.gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=(34, 80, 140),
        )
        server.gui.main_panel.dock_right()
        # viser's own lights wash colours out, and colours mean something here
        server.scene.configure_default_lights(enabled=False)
        server.scene.add_light_ambient("/light/sky", intensity=1.6)
        for name, place in (("key", (0.6, -0.5, 1.0)), ("fill", (-0.7, 0.6, -0.4))):
            server.scene.add_light_directional(
                f"/light/{name}", intensity=1.3, position=place, cast_shadow=False
            )
        server.scene.set_background_image(_backdrop(), format="png")
        server.scene.world_axes.visible = False
        server.initial_camera.near = 1.0
        server.initial_camera.far = 50_000.0
        server.initial_camera.fov = float(np.radians(40))

        async def clicked(event: viser.SceneClickEvent) -> None:
            # a click on a bolt reaches its own callback first, and then this one too
            if self._node_click == (event.client_id, event.screen_pos):
                return
            self.do(self._pick, np.array(event.ray_origin), np.array(event.ray_direction))

        server.scene.on_click()(clicked)  # pyright: ignore[reportArgumentType] - viser awaits it

    def tab(self, label: str, icon: viser.IconName | None = None) -> viser.GuiTabHandle:
        """Add a tab to the panel; `with page.tab("Review"):` puts what is added inside."""
        return self._tabs.add_tab(label, icon)

    def add_html(self, order: float | None = None) -> HtmlPane:
        """Add an empty piece of HTML to the tab that is open.

        Args:
            order: Place in it. Outside of all tabs the headline has 0 and the tabs have 100.
        """
        return HtmlPane(self.server.gui, order)

    def do(self, work: Callable[..., None], *arguments: Any) -> None:
        """Run something on the page's own thread, after all that was asked for before.

        An error of ours becomes a note in the page; any other is logged with its traceback and
        noted too: the page goes on.
        """
        self._work.put(lambda: work(*arguments))

    def on_node_click(
        self,
        node: viser.MeshHandle | viser.CylinderHandle | viser.IcosphereHandle,
        then: Callable[[], None],
    ) -> None:
        """Run something when a mesh is clicked; the click does not count as one on the surface."""

        async def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
            self._node_click = (event.client_id, event.screen_pos)
            self.do(then)

        node.on_click(clicked)

    def make_pickable(self, layer: PickLayer) -> None:
        """Let clicks find the points of a layer; one of the same name is replaced."""
        self.forget_pickable(layer.name)
        self._pickable.append(layer)

    def forget_pickable(self, name: str) -> None:
        """Let clicks pass through a layer."""
        self._pickable = [layer for layer in self._pickable if layer.name != name]

    def on_surface_click(self, then: Callable[[SurfaceClick], None]) -> None:
        """Run something whenever a point of a pickable layer is clicked."""
        self._surface_click.append(then)

    def tell(
        self, kind: Literal["info", "good", "error"], title: str, text: str, seconds: float = 8.0
    ) -> None:
        """Show a note in every open browser for a while."""
        for client in self.server.get_clients().values():
            client.add_notification(
                title, text, auto_close_seconds=seconds, color=_NOTE_COLORS[kind]
            )

    def look_at(
        self, target_mm: FloatArray, from_mm: FloatArray, up: FloatArray | None = None
    ) -> None:
        """Put every viewer, also later ones, at a place.

        Args:
            target_mm: Shape (3,), frame of the page: turned about, in the middle of the picture.
            from_mm: Shape (3,), where the viewer stands.
            up: Shape (3,); kept as it is by default.
        """
        start = self.server.initial_camera
        if up is not None:
            self.server.scene.set_up_direction((float(up[0]), float(up[1]), float(up[2])))
            start.up = up
        start.position = from_mm
        start.look_at = target_mm
        for client in self.server.get_clients().values():
            if up is not None:
                client.camera.up_direction = up
            client.camera.position = from_mm
            client.camera.look_at = target_mm

    def at_stop(self, work: Callable[[], None]) -> None:
        """Run something when the page is closed, the last one added first."""
        self._at_stop.append(work)

    def wait(self) -> None:
        """Return when the page is stopped; Ctrl-C is passed on."""
        while not self.stopped.wait(0.2):
            pass

    def stop(self) -> None:
        """End threads, close browsers' connections, free the port; safe to call twice."""
        if self.stopped.is_set():
            return
        self.stopped.set()
        for work in reversed(self._at_stop):
            work()
        self._work.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=10.0)
        self.server.stop()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _pick(self, origin_mm: FloatArray, direction: FloatArray) -> None:
        hit = pick_point(self._pickable, origin_mm, direction)
        if hit is None:
            return
        layer, row = hit
        click = SurfaceClick(layer=layer.name, point_mm=layer.points[row].copy(), row=row)
        for then in self._surface_click:
            then(click)

    def _work_off(self) -> None:
        while (work := self._work.get()) is not None:
            try:
                work()
            except BoltposeError as error:
                self.tell("error", "Not done", str(error))
            except Exception as error:  # noqa: BLE001 - one bad click must not end the page
                _LOG.exception("in the page")
                self.tell("error", "A fault in boltpose", f"{type(error).__name__}: {error}")
