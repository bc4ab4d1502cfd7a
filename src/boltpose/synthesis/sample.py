"""The tasks of data sets: settings and a number in, all files of one sample out."""

from __future__ import annotations

from boltpose.synthesis.head_surface import head_centroids
from boltpose.synthesis.motors import ScannedMotor, scan_sampled_motor
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.stopwatch import Stopwatch
from boltpose.synthesis.truth import prior_truth
from boltpose.synthesis.write import (
    Sample,
    SampleFile,
    json_bytes,
    ply_bytes,
    rounded,
    sample_name,
)


def make_motor_sample(settings: DataSetSettings, number: int) -> Sample:
    """Make the full scan of motor `number` and its truth.

    A pure function: the same arguments give the same bytes, in any process on any machine of the
    same kind.

    Raises:
        InfeasibleSampleError: Many draws in a row could not be built.
    """
    watch = Stopwatch()
    motor = scan_sampled_motor(settings, number, watch)
    with watch.stage("truth"):
        files = motor_files(settings, motor)
    return Sample(
        name=sample_name(number),
        files=tuple(files),
        seconds=watch.seconds,
        retries=motor.retries,
    )


def motor_files(settings: DataSetSettings, motor: ScannedMotor) -> list[SampleFile]:
    """The full scan of a motor and its truth, as files."""
    model = motor.model
    truth = prior_truth(
        model,
        motor.prior_from_motor,
        motor.scan.labels,
        number=motor.number,
        family_number=settings.families.index(settings.family_of(motor.number)),
        seed=settings.seed,
        cell_mm=motor.cell_mm,
        scan_points=motor.points_on_bolts(),
        centroids=head_centroids(model),
        retries=motor.retries,
    )
    truth["size_mm"] = rounded(motor.size_mm)
    wear = None if motor.wear is None else motor.wear.model_dump(mode="json")
    files = {
        "prior.ply": ply_bytes(motor.points_prior, motor.scan.labels),
        "prior_gt.json": json_bytes(truth),
        "spec.json": json_bytes(model.spec.model_dump(mode="json")),
        "wear.json": json_bytes({"seed": motor.wear_seed, "wear": wear}),
    }
    return [SampleFile(name=name, data=data) for name, data in files.items()]
