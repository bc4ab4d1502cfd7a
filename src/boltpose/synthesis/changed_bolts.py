"""Motors whose bolts were lost or exchanged between full scan and clamping, seen before and after.

    python -m boltpose.synthesis.changed_bolts -n 15 --clampings 2 --seed 2000 -o DIR

A pair of folders per motor, both in the layout of `boltpose synth scenes`: `motor_0000(2k)` holds
the full scan of the motor as built, `motor_0000(2k+1)` that of the same motor after the changes.
Every clamping gives two views, by the same camera from the same place: of the motor that was
scanned (even numbers) and of the other one (odd). So a screw that one scan has and the other
motor lacks is missing in one folder and surplus in the other.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from boltpose.factory.changes import ChangeRates, draw_changes
from boltpose.factory.families import FAMILIES
from boltpose.factory.model import MotorModel, SceneModel, TrueBolt
from boltpose.factory.scene import CLAMPS, place_motor
from boltpose.factory.viewpoint import suggest_camera
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.hand_held import scan_motor
from boltpose.sensor.hand_held_config import sample_hand_held
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import CapturedView, capture_view
from boltpose.sensor.structured_light_config import sample_structured_light
from boltpose.synthesis.head_surface import sample_outer_head, seen_share
from boltpose.synthesis.motors import ScannedMotor, scan_sampled_motor
from boltpose.synthesis.retry import draw_until_built
from boltpose.synthesis.sample import motor_files
from boltpose.synthesis.seeds import Purpose, generator
from boltpose.synthesis.settings import DataSetSettings, Kind
from boltpose.synthesis.stopwatch import Stopwatch
from boltpose.synthesis.truth import (
    SeenBolt,
    ViewBolt,
    camera_truth,
    match_bolts,
    scene_truth,
    view_truth,
)
from boltpose.synthesis.views import put_worn_motor
from boltpose.synthesis.write import (
    Sample,
    SampleFile,
    depth_png_bytes,
    finished_samples,
    hand_eye_bytes,
    json_bytes,
    label_png_bytes,
    rounded,
    sample_name,
    write_sample,
)

_log = logging.getLogger(__name__)
RATES = ChangeRates(bolt_lost=0.3, bolt_replaced=0.3)
"""Many, so that few motors give many cases; all else happens as often as it does elsewhere."""
_SCALE_MM = 0.05
_FILLED_SHARE = (0.4, 0.9)
_FOCAL_RANGE = (0.8, 2.6)
"""As `synthesis.views` draws its lenses."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line; a run resumes where one was ended."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-n", "--count", type=int, default=15, help="motors, two folders each")
    parser.add_argument("--clampings", type=int, default=2, help="per motor, two views each")
    parser.add_argument("--seed", type=int, default=2000)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    settings = DataSetSettings(
        kind=Kind.SCENES,
        seed=given.seed,
        families=FAMILIES,
        views=given.clampings,
        clamps=CLAMPS,
    )
    given.output.mkdir(parents=True, exist_ok=True)
    for number in range(given.count):
        names = {sample_name(2 * number), sample_name(2 * number + 1)}
        if names <= finished_samples(given.output):
            continue
        with threadpool_limits(1):
            for sample in make_changed_pair(settings, number):
                write_sample(given.output, sample)
        _log.info("%s", " ".join(sorted(names)))


def make_changed_pair(settings: DataSetSettings, number: int) -> tuple[Sample, Sample]:
    """Make motor `number` as built and after its changes; a pure function.

    Raises:
        InfeasibleSampleError: Many draws in a row could not be built.
    """
    watch = Stopwatch()
    built = scan_sampled_motor(settings, number, watch)
    changed = draw_changes(built.model, generator(settings.seed, number, Purpose.CHANGES), RATES)
    scan_rng = generator(settings.seed, number, Purpose.SCAN, attempt=1)
    config = replace(sample_hand_held(scan_rng), cell_mm=built.cell_mm)
    after = replace(
        built,
        model=changed.model,
        scan=scan_motor(changed.model.parts, config, scan_rng),
    )
    shots = [_shoot(settings, built, after, view) for view in range(settings.views)]
    changes = [f"{change.kind}: {change.subject}" for change in changed.changes]
    return (
        _sample(settings, 2 * number, (built, after), shots, changes),
        _sample(
            settings, 2 * number + 1, (after, built), [shot.swapped() for shot in shots], changes
        ),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Shot:
    """One clamping: the scenes with either motor, and what the camera saw of them."""

    scenes: tuple[SceneModel, SceneModel]
    captured: tuple[CapturedView, CapturedView]
    table_from_camera: Transform

    def swapped(self) -> _Shot:
        return replace(
            self,
            scenes=(self.scenes[1], self.scenes[0]),
            captured=(self.captured[1], self.captured[0]),
        )


def _shoot(settings: DataSetSettings, built: ScannedMotor, after: ScannedMotor, view: int) -> _Shot:
    number = built.number

    def draw(attempt: int) -> _Shot:
        def rng(purpose: Purpose) -> np.random.Generator:
            return generator(settings.seed, number, purpose, view=view, attempt=attempt)

        clamp_rng = rng(Purpose.CLAMP)
        clamp = str(clamp_rng.choice(settings.clamps))
        if attempt == 0:
            clamp = settings.clamp_of(number, view)
        placed = place_motor(built.fresh, clamp_rng, clamp)
        table_from_camera = suggest_camera(placed, rng(Purpose.CAMERA))
        sensor_rng = rng(Purpose.SENSOR)
        camera = _choose_camera(placed, table_from_camera, settings, sensor_rng)
        config = sample_structured_light(sensor_rng, camera)
        scenes = (put_worn_motor(placed, built.model), put_worn_motor(placed, after.model))
        state = sensor_rng.bit_generator.state

        def capture(scene: SceneModel) -> CapturedView:
            sensor_rng.bit_generator.state = state
            return capture_view(RayCaster(scene.solids), table_from_camera, config, sensor_rng)

        return _Shot(
            scenes=scenes,
            captured=(capture(scenes[0]), capture(scenes[1])),
            table_from_camera=table_from_camera,
        )

    return draw_until_built(f"{sample_name(number)} view {view}", draw).result


def _choose_camera(
    scene: SceneModel,
    table_from_camera: Transform,
    settings: DataSetSettings,
    rng: np.random.Generator,
) -> PinholeCamera:
    vertices = [solid.vertices for solid in scene.solids if solid.part != Part.BACKGROUND]
    points = table_from_camera.inverse().apply(np.concatenate(vertices))
    size = np.array([settings.width_px, settings.height_px])
    spread = float((np.ptp(points[:, :2] / points[:, 2:], axis=0) / size).max())
    shortest, longest = (float(size.max()) * factor for factor in _FOCAL_RANGE)
    return PinholeCamera(
        width=settings.width_px,
        height=settings.height_px,
        focal_px=float(np.clip(rng.uniform(*_FILLED_SHARE) / spread, shortest, longest)),
        centre_px=((settings.width_px - 1) / 2, (settings.height_px - 1) / 2),
    )


def _sample(
    settings: DataSetSettings,
    number: int,
    motors: tuple[ScannedMotor, ScannedMotor],
    shots: Sequence[_Shot],
    changes: Sequence[str],
) -> Sample:
    """The folder of one motor: its full scan, and every clamping with it and with the other."""
    scanned = replace(motors[0], number=number)
    files = motor_files(_with_family(settings, motors[0].number, number), scanned)
    cameras: dict[str, Any] = {}
    scenes: dict[str, Any] = {}
    bolts: dict[str, Any] = {}
    for row, shot in enumerate(shots):
        for which in (0, 1):
            index, captured = 2 * row + which, shot.captured[which]
            scene = shot.scenes[which]
            camera_from_motor = shot.table_from_camera.inverse() @ scene.table_from_motor
            camera_from_prior = camera_from_motor @ scanned.prior_from_motor.inverse()
            base_from_camera = Transform("base", "table", np.eye(4)) @ shot.table_from_camera
            key = str(index)
            cameras[key] = camera_truth(captured.camera_matrix, _SCALE_MM)
            scenes[key] = scene_truth(number, camera_from_prior, base_from_camera)
            clamped = motors[which].model
            partners = match_bolts(scanned.model.bolts, clamped.bolts)
            seen = {
                bolt.id: _see(bolt, clamped, scene, camera_from_motor, captured)
                for bolt in clamped.bolts
            }
            bolts[key] = view_truth(
                [
                    ViewBolt(
                        scanned=bolt,
                        clamped=partner,
                        head_centroid=(partner or bolt).head_centre,
                        seen=seen[partner.id]
                        if partner
                        else SeenBolt(visible_fraction=0.0, pixel_count=0),
                    )
                    for bolt, partner in zip(scanned.model.bolts, partners, strict=True)
                ],
                captured.labels,
                captured.depth_mm > 0,
                clamp_number=settings.clamps.index(scene.clamp_name),
                clamp_name=scene.clamp_name,
                prior_from_motor=scanned.prior_from_motor,
                camera_from_prior=camera_from_prior,
                base_from_camera=base_from_camera,
                changes=list(changes) if which else [],
            )
            known = {partner.id for partner in partners if partner is not None}
            bolts[key]["surplus"] = [
                {
                    "head_top_B": rounded(camera_from_motor.apply(bolt.head_top)),
                    "head_diameter": rounded(bolt.head_diameter_mm),
                    "head_height": rounded(bolt.head_height_mm),
                    "head": str(bolt.spec.head),
                    "visible_fraction": rounded(seen[bolt.id].visible_fraction, 3),
                }
                for bolt in clamped.bolts
                if bolt.id not in known
            ]
            files += [
                SampleFile(
                    name=f"depth/{index:06d}.png",
                    data=depth_png_bytes(captured.depth_mm, _SCALE_MM),
                ),
                SampleFile(name=f"label/{index:06d}.png", data=label_png_bytes(captured.labels)),
                SampleFile(
                    name=f"hand_eye/{index:06d}.yaml",
                    data=hand_eye_bytes(base_from_camera.matrix),
                ),
            ]
    documents = {"scene_camera": cameras, "scene_gt": scenes, "bolts": bolts}
    files += [
        SampleFile(name=f"{name}.json", data=json_bytes(document))
        for name, document in documents.items()
    ]
    return Sample(name=sample_name(number), files=tuple(files))


def _with_family(settings: DataSetSettings, number: int, other: int) -> DataSetSettings:
    """Settings in which sample `other` is of the family that sample `number` has here."""
    count = len(settings.families)
    family = settings.family_of(number)
    rotated = list(settings.families)
    rotated[other % count], rotated[number % count] = family, settings.families[other % count]
    return replace(settings, families=tuple(rotated))


def _see(
    bolt: TrueBolt,
    clamped: MotorModel,
    scene: SceneModel,
    camera_from_motor: Transform,
    captured: CapturedView,
) -> SeenBolt:
    solid = next(part for part in clamped.parts if part.bolt_id == bolt.id)
    row = next(k for k, part in enumerate(scene.solids) if part.bolt_id == bolt.id)
    measured = captured.points()[captured.solid_index.reshape(-1)[captured.pixels] == row]
    surface = sample_outer_head(bolt, solid)
    return SeenBolt(
        visible_fraction=seen_share(camera_from_motor.apply(surface), measured),
        pixel_count=len(measured),
    )


if __name__ == "__main__":
    main()
