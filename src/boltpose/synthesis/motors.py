"""One motor of a data set: drawn, built, worn and scanned."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.factory.families import sample_model
from boltpose.factory.model import MotorModel, bounds_mm
from boltpose.factory.wear import wear_motor
from boltpose.factory.wear_spec import WearSpec, sample_wear
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.hand_held import HandHeldScan, scan_motor
from boltpose.sensor.hand_held_config import HandHeldConfig, sample_hand_held
from boltpose.synthesis.retry import draw_until_built
from boltpose.synthesis.seeds import Purpose, generator, seed_of
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.stopwatch import Stopwatch
from boltpose.synthesis.write import sample_name

_SCAN_ORIGIN_MM = 200.0
"""Largest coordinate of the motor in the full scan's own, arbitrary frame."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ScannedMotor:
    """A motor as it lay under the hand-held scanner."""

    number: int
    fresh: MotorModel
    """As it was built, with few triangles."""
    model: MotorModel
    """The same, worn: what scanners see."""
    wear: WearSpec | None
    """None: as new."""
    wear_seed: int
    scan: HandHeldScan
    """Points in frame `motor`."""
    prior_from_motor: Transform
    cell_mm: float
    retries: tuple[str, ...]

    @property
    def points_prior(self) -> FloatArray:
        """Shape (N, 3), mm, frame `prior`."""
        return self.prior_from_motor.apply(self.scan.points)

    @property
    def size_mm(self) -> FloatArray:
        """Shape (3,): the box around the motor, frame `motor`."""
        low, high = bounds_mm(self.model.parts)
        return high - low

    def points_on_bolts(self) -> dict[str, int]:
        """Scan points on the head of every bolt, by id."""
        counts = np.bincount(
            self.scan.solid_index[self.scan.labels == Part.BOLT], minlength=len(self.model.parts)
        )
        return {
            solid.bolt_id: int(counts[index])
            for index, solid in enumerate(self.model.parts)
            if solid.bolt_id is not None
        }


def scan_sampled_motor(settings: DataSetSettings, number: int, watch: Stopwatch) -> ScannedMotor:
    """Draw motor `number` of a data set, build it, wear it and scan it.

    Raises:
        InfeasibleSampleError: Many draws in a row could not be built.
    """
    seed = settings.seed
    family = settings.family_of(number)

    def draw(attempt: int) -> tuple[MotorModel, MotorModel, WearSpec | None, int]:
        with watch.stage("build"):
            drawn = sample_model(generator(seed, number, Purpose.SPEC, attempt=attempt), family)
            spec = drawn.spec.model_copy(update={"name": sample_name(number)})
            model = replace(drawn, spec=spec)
        relief_seed = seed_of(seed, number, Purpose.WEAR_RELIEF, attempt=attempt)
        if not settings.with_wear:
            return model, model, None, relief_seed
        with watch.stage("wear"):
            wear = sample_wear(generator(seed, number, Purpose.WEAR, attempt=attempt))
            return model, wear_motor(model, wear, relief_seed), wear, relief_seed

    drawn = draw_until_built(sample_name(number), draw)
    fresh, model, wear, relief_seed = drawn.result
    rng = generator(seed, number, Purpose.SCAN)
    config: HandHeldConfig = sample_hand_held(rng)
    with watch.stage("scan"):
        scan = scan_motor(model.parts, config, rng)
    return ScannedMotor(
        number=number,
        fresh=fresh,
        model=model,
        wear=wear,
        wear_seed=relief_seed,
        scan=scan,
        prior_from_motor=_scan_frame(generator(seed, number, Purpose.SCAN_FRAME)),
        cell_mm=config.cell_mm,
        retries=drawn.retries,
    )


def _scan_frame(rng: np.random.Generator) -> Transform:
    """Where the scanner's software has put the motor: anywhere."""
    return Transform.from_parts(
        "prior",
        "motor",
        Rotation.random(rng=rng).as_matrix(),
        rng.uniform(-_SCAN_ORIGIN_MM, _SCAN_ORIGIN_MM, 3),
    )
