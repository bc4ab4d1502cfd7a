"""A result in the page: scan, registered prior, bolts, verdict, and what can be switched."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, UInt8Array
from boltpose.geometry.transforms import Transform
from boltpose.picture import paint
from boltpose.picture.bolt_marks import INK_OF, Ink
from boltpose.report.scores import missed_although_ok
from boltpose.schema import BoltState, LocatedBolt, LocateResult, Part, Prior, Scan
from boltpose.viewer.bolts import BoltLayer, BoltMark3d
from boltpose.viewer.page import Page
from boltpose.viewer.panel import Sign, headline, sign_of, verdict_panel
from boltpose.viewer.panel_bolts import bolt_detail, bolt_table
from boltpose.viewer.points import PointLayer, spacing_of
from boltpose.viewer.scan_colors import ColorMode, ScanColors, css
from boltpose.viewer.scan_layer import ScanLayer
from boltpose.viewer.setting import Setting, viewpoint
from boltpose.viewer.shade import light, lit_colors
from boltpose.viewer.switches import PriorPart, Switches

_PRIOR = 0.5 * paint.PRIOR + 0.5
"""Paler than in the picture: the gear has that blue here."""
_REJECTED = np.array([0.80, 0.42, 0.45])
_BESIDE_MM = 1.6
"""A scan point so near to a prior's covers it: more than the spacing of either."""
_ENOUGH = 200_000
_NO_BOLT: str = "none"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shown:
    """A result, and what it was made from."""

    result: LocateResult
    scan: Scan
    prior: Prior | None
    """None where none of many priors could be named."""
    timings_ms: Mapping[str, float] = field(default_factory=dict)


class ResultPage:
    """One result at a time; whatever comes next first takes away all that was there.

    So nobody can take an old result for that of a new scan: between two results the page shows
    neither points nor bolts, and its sign says what it waits for.
    """

    def __init__(self, page: Page) -> None:
        """Build the tabs; the page says that it waits."""
        self.page = page
        # results come on a thread of their own, clicks on the page's
        self._lock = threading.RLock()
        self.scan = ScanLayer(page)
        self.prior = PointLayer(page, "prior")
        self.bolts = BoltLayer(page)
        self.setting = Setting(page)
        self.shown: Shown | None = None
        """What the page shows; None while it shows nothing."""
        self._colors: ScanColors | None = None
        self._mode = ColorMode.PLAIN
        self._rejected = page.server.scene.add_label(
            "/rejected",
            "REJECTED candidate: do not use",
            visible=False,
            anchor="bottom-center",
            font_screen_scale=1.8,
        )
        gui = page.server.gui
        with page.tab("Result"):
            self._verdict = page.add_html()
        with page.tab("Bolts"):
            self._table = page.add_html()
            self._choice = gui.add_dropdown("Bolt", [_NO_BOLT], initial_value=_NO_BOLT)
            self._detail = page.add_html()
        with page.tab("View"):
            self.switches = Switches(self)
        self.bolts.on_click(self._bolt_clicked)
        self._choice.on_update(lambda _: page.do(self._bolt_chosen))
        self.wait(Sign(kind="wait", word="No scan", text="Nothing is shown yet."))

    def wait(self, sign: Sign) -> None:
        """Take away everything and say what is going on instead."""
        with self._lock:
            self._wait(sign)

    def _wait(self, sign: Sign) -> None:
        self.shown, self._colors = None, None
        with self.page.server.atomic():
            self.bolts.clear()
            self.prior.clear()
            self.setting.clear()
            self._rejected.visible = False
            self.page.headline.show(headline(sign))
            self._verdict.show(None)
            self._table.show(None)
            self._detail.show(None)
            self._choice.options = (_NO_BOLT,)
        self.switches.explain([], None)
        self.scan.clear()

    def show(self, shown: Shown, *, scan_name: str | None = None) -> None:
        """Show a result; a refused one with its reasons, and no bolts to follow.

        Args:
            shown: The result.
            scan_name: What people call the scan; by default its file's name.
        """
        with self._lock:
            self._show(shown, scan_name or shown.scan.source)

    def _show(self, shown: Shown, scan_name: str) -> None:
        result, scan = shown.result, shown.scan
        page_from_camera = page_frame(result)
        points = page_from_camera.apply(scan.points)
        colors = ScanColors(scan, result, shown.prior)
        # a file that calls itself refused and holds bolts all the same gets none of them shown
        is_usable = result.is_ok and not missed_although_ok(result.verdict)
        bolts = result.bolts if is_usable else ()
        self.shown, self._colors = shown, colors
        with self.page.server.atomic():
            self._mode = self.switches.offer(colors.modes(), [_ink(bolt) for bolt in bolts])
            self.bolts.show([_mark(bolt, result.frame) for bolt in bolts])
            self._show_prior(shown)
            self.setting.show(
                scan,
                page_from_camera,
                has_base=result.frame == "base",
                extra_heads=result.extra_heads if result.is_ok else (),
            )
            self.page.headline.show(headline(sign_of(result, scan_name)))
            self._verdict.show(verdict_panel(result, shown.timings_ms))
            self._table.show(bolt_table(bolts))
            self._detail.show(bolt_detail(None, result.frame))
            self._choice.options = (_NO_BOLT, *(_choice_text(bolt) for bolt in bolts))
        mode = self._mode
        self.scan.show(points, lambda rows: colors.of(mode, rows))
        self.look("motor")

    def recolor(self, mode: ColorMode) -> None:
        """Colour the scan by something else."""
        with self._lock:
            colors, shown = self._colors, self.shown
            if colors is not None and shown is not None and mode in colors.modes():
                self._mode = mode
                self.scan.recolor(lambda rows: colors.of(mode, rows))
                self._show_prior(shown)

    @property
    def labels_from_file(self) -> bool:
        """True if the scan's own file says which part each point belongs to."""
        return self.shown is not None and self.shown.scan.labels is not None

    def prior_legend(self, mode: ColorMode) -> list[tuple[str, str]]:
        """Colour and meaning of the registered prior; nothing if there is none."""
        if self.shown is None or self.shown.result.registration is None:
            return []
        if self.shown.result.is_ok:
            if mode is ColorMode.VISIBILITY:
                return []  # it has the colours of the scan, which say what was seen of it
            return [(css(_PRIOR), "registered prior: known, not measured")]
        return [(css(_REJECTED), "rejected candidate: do not use")]

    def look(self, where: str) -> None:
        """Put the viewer before the `motor`, `behind` it, at the `camera`, or off to see `all`."""
        if self.shown is None:
            return
        result, prior = self.shown.result, self.shown.prior
        page_from_camera = page_frame(result)
        up = np.array([0.0, 0.0, 1.0]) if result.frame == "base" else np.array([0.0, -1.0, 0.0])
        if result.registration is not None and prior is not None and len(prior.points):
            subject = (page_from_camera @ result.registration.camera_from_prior).apply(prior.points)
        else:
            subject = page_from_camera.apply(self.shown.scan.points)
        low, high = np.quantile(subject, (0.01, 0.99), axis=0)
        middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        camera = page_from_camera.translation_mm
        if where == "all":
            places = np.vstack([low, high, camera, np.zeros(3)])
            middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
            radius = 0.33 * float(np.linalg.norm(np.ptp(places, axis=0)))
        if where == "camera":
            # the camera's own up: its picture is then seen as it was taken
            self.page.look_at(middle, camera, up=-page_from_camera.rotation[:, 1])
            return
        turn = np.radians(205 if where == "behind" else 25)
        self.page.look_at(
            middle, viewpoint(middle, radius, up, camera - middle, float(turn)), up=up
        )

    def show_prior(self) -> None:
        """Show as much of the registered prior as is wanted."""
        with self._lock:
            if self.shown is not None:
                self._show_prior(self.shown)

    def _show_prior(self, shown: Shown) -> None:
        result, prior, part = shown.result, shown.prior, self.switches.prior_part
        self._rejected.visible = False
        if result.registration is None or prior is None or len(prior.points) == 0:
            self.prior.clear()
            return
        page_from_prior = page_frame(result) @ result.registration.camera_from_prior
        points = page_from_prior.apply(prior.points)
        tints = None if self._colors is None else self._colors.prior_tints(self._mode)
        colors = _prior_colors(prior, page_from_prior, result, tints)
        spacing_mm = spacing_of(prior.points)
        if not result.is_ok:
            self._rejected.position = points[int(np.argmax(points[:, 2]))]
            self._rejected.visible = part is not PriorPart.NONE
        elif part is PriorPart.UNSEEN:
            # both surfaces in one place would flicker through each other
            keep = ~is_measured(prior, shown.scan, result.registration.camera_from_prior)
            points, colors = points[keep], colors[keep]
        if part is PriorPart.NONE:
            self.prior.clear()
        else:
            self.prior.show(points, colors, spacing_mm)

    def _bolt_clicked(self, bolt_id: str) -> None:
        with self._lock:
            bolt = self._bolt(bolt_id)
            if bolt is not None and self.shown is not None:
                self._detail.show(bolt_detail(bolt, self.shown.result.frame))
                self._choice.value = _choice_text(bolt)

    def _bolt_chosen(self) -> None:
        with self._lock:
            bolt = self._bolt(self._choice.value.split(" ", 1)[0])
            frame = "" if self.shown is None else self.shown.result.frame
            if bolt is None:
                self.bolts.choose(None)
                self._detail.show(bolt_detail(None, frame) if self.shown is not None else None)
            elif self.bolts.chosen != bolt.id:
                self.bolts.choose(bolt.id)
                self._detail.show(bolt_detail(bolt, frame))

    def _bolt(self, bolt_id: str) -> LocatedBolt | None:
        if self.shown is None or not self.shown.result.is_ok:
            return None
        return next((bolt for bolt in self.shown.result.bolts if bolt.id == bolt_id), None)


def page_frame(result: LocateResult) -> Transform:
    """From `camera` to the frame of the page, which is that of the result."""
    if result.frame == "base" and result.base_from_camera is not None:
        return result.base_from_camera
    return Transform.identity("camera", "camera")


def _ink(bolt: LocatedBolt) -> Ink:
    return Ink.FORBIDDEN if bolt.state is BoltState.CONTRADICTED else INK_OF[bolt.visibility]


def _mark(bolt: LocatedBolt, frame: str) -> BoltMark3d:
    text = f"{bolt.id} {bolt.name}".strip() + ("" if bolt.is_sure else " ?")
    if bolt.state is BoltState.CONTRADICTED:
        text = f"\N{MULTIPLICATION X} {text}: NOT THERE"
    return BoltMark3d(
        id=bolt.id,
        text=text,
        page_from_bolt=bolt.frame_from_bolt,
        head_diameter_mm=bolt.head_diameter_mm,
        head_height_mm=bolt.head_height_mm,
        ink=_ink(bolt),
        covariance_mm2=bolt.covariance_mm2,
        tip=bolt_detail(bolt, frame),
    )


def _choice_text(bolt: LocatedBolt) -> str:
    return f"{bolt.id} {bolt.name}".strip()


def is_measured(prior: Prior, scan: Scan, camera_from_prior: Transform) -> BoolArray:
    """Tell which points of a posed prior have scan points beside them; shape (N,)."""
    points = camera_from_prior.inverse().apply(scan.points)
    low, high = prior.points.min(axis=0) - _BESIDE_MM, prior.points.max(axis=0) + _BESIDE_MM
    near = points[((points >= low) & (points <= high)).all(axis=1)]
    if len(near) == 0:
        return np.zeros(len(prior.points), dtype=np.bool_)
    near = near[:: max(1, len(near) // _ENOUGH)]
    distance, _ = KDTree(near).query(prior.points, distance_upper_bound=_BESIDE_MM, workers=-1)
    return np.isfinite(distance)


def _prior_colors(
    prior: Prior, page_from_prior: Transform, result: LocateResult, tints: FloatArray | None
) -> UInt8Array:
    normals = page_from_prior.rotate(prior.normals)
    up = np.array([0.0, 0.0, 1.0]) if result.frame == "base" else np.array([0.0, -1.0, 0.0])
    towards = np.array([1.0, 0.0, 0.0]) if result.frame == "base" else np.array([0.0, 0.0, -1.0])
    if tints is None:
        tints = np.tile(_PRIOR if result.is_ok else _REJECTED, (len(normals), 1))
        tints[prior.labels == Part.BOLT] *= 0.85
    return lit_colors(tints, light(normals, up, towards))
