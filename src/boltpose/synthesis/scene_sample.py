"""The task of data sets of scenes: a motor's full scan, and its views in clamps."""

from __future__ import annotations

from typing import Any

from boltpose.arrays import FloatArray
from boltpose.synthesis.motors import ScannedMotor, scan_sampled_motor
from boltpose.synthesis.sample import motor_files
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.stopwatch import Stopwatch
from boltpose.synthesis.truth import camera_truth, scene_truth, view_truth
from boltpose.synthesis.views import SampledView, sample_views
from boltpose.synthesis.write import (
    Sample,
    SampleFile,
    depth_png_bytes,
    hand_eye_bytes,
    json_bytes,
    label_png_bytes,
    sample_name,
)

_DEPTH_SCALES_MM = (0.02, 0.05, 0.1)
"""Steps of the depth image; the first that reaches the furthest pixel with 16 bits is taken."""
_LARGEST_STEP = 65535


def make_scene_sample(settings: DataSetSettings, number: int) -> Sample:
    """Make the full scan of motor `number`, its views and their truth; pure as well.

    Raises:
        InfeasibleSampleError: Many draws in a row could not be built.
    """
    watch = Stopwatch()
    motor = scan_sampled_motor(settings, number, watch)
    with watch.stage("truth"):
        files = motor_files(settings, motor)
    cameras: dict[str, Any] = {}
    scenes: dict[str, Any] = {}
    bolts: dict[str, Any] = {}
    retries = list(motor.retries)
    for clamping in range(settings.views):
        views = sample_views(settings, motor, clamping, watch)
        with watch.stage("write"):
            for angle, view in enumerate(views):
                index = clamping * settings.angles + angle
                scale_mm = _depth_scale_mm(view.captured.depth_mm)
                files += _view_files(view, index, scale_mm)
                key = str(index)
                cameras[key] = camera_truth(view.captured.camera_matrix, scale_mm)
                scenes[key] = scene_truth(number, view.camera_from_prior, view.base_from_camera)
                bolts[key] = _view_truth(settings, motor, view)
                if settings.angles > 1:
                    bolts[key]["clamping"] = clamping
        retries += views[0].retries
    documents = {"scene_camera": cameras, "scene_gt": scenes, "bolts": bolts}
    files += [
        SampleFile(name=f"{name}.json", data=json_bytes(document))
        for name, document in documents.items()
    ]
    return Sample(
        name=sample_name(number),
        files=tuple(files),
        seconds=watch.seconds,
        retries=tuple(retries),
    )


def _view_files(view: SampledView, index: int, scale_mm: float) -> list[SampleFile]:
    captured = view.captured
    files = {
        f"depth/{index:06d}.png": depth_png_bytes(captured.depth_mm, scale_mm),
        f"label/{index:06d}.png": label_png_bytes(captured.labels),
        f"hand_eye/{index:06d}.yaml": hand_eye_bytes(view.base_from_camera.matrix),
    }
    return [SampleFile(name=name, data=data) for name, data in files.items()]


def _view_truth(
    settings: DataSetSettings, motor: ScannedMotor, view: SampledView
) -> dict[str, Any]:
    return view_truth(
        view.bolts,
        view.captured.labels,
        view.captured.depth_mm > 0,
        clamp_number=settings.clamps.index(view.clamp_name),
        clamp_name=view.clamp_name,
        prior_from_motor=motor.prior_from_motor,
        camera_from_prior=view.camera_from_prior,
        base_from_camera=view.base_from_camera,
        changes=[f"{change.kind}: {change.subject}" for change in view.changes],
        retries=view.retries,
    )


def _depth_scale_mm(depth_mm: FloatArray) -> float:
    furthest = float(depth_mm.max())
    return next(scale for scale in _DEPTH_SCALES_MM if furthest / scale <= _LARGEST_STEP)
