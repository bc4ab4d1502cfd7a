"""`sample_motor`: draws motors of many families, each buildable."""

from __future__ import annotations

import numpy as np

from boltpose.errors import ConfigError
from boltpose.factory.build import build_motor
from boltpose.factory.checks import BoltPlaceError
from boltpose.factory.draw_bodies import draw_bodies
from boltpose.factory.draw_bolts import draw_bolts
from boltpose.factory.draw_extras import draw_extras
from boltpose.factory.mirror import mirror_motor
from boltpose.factory.model import MotorModel
from boltpose.factory.plans import PLANS
from boltpose.factory.spec import MotorSpec

FAMILIES: tuple[str, ...] = tuple(plan.name for plan in PLANS)
"""Topologies that `sample_motor` knows."""

_MIRRORED = 0.5
_MAX_DRAWS = 60
_MIN_BOLTS = 4


def sample_motor(rng: np.random.Generator, family: str | None = None) -> MotorSpec:
    """Draw the specification of a motor that can be built; see `sample_model`."""
    return sample_model(rng, family).spec


def sample_model(rng: np.random.Generator, family: str | None = None) -> MotorModel:
    """Draw a motor and build it: only building shows that a motor can be built.

    Args:
        rng: Source of randomness; the same state gives the same motor.
        family: One of `FAMILIES`; None draws one.

    Raises:
        ConfigError: There is no such family.
    """
    if family is None:
        family = FAMILIES[int(rng.integers(len(FAMILIES)))]
    if family not in FAMILIES:
        raise ConfigError(f"family must be one of {', '.join(FAMILIES)}, got {family}")
    plan = PLANS[FAMILIES.index(family)]
    refusal = ""
    for _ in range(_MAX_DRAWS):
        draw = np.random.default_rng(rng.integers(2**63))
        try:
            spec = draw_extras(draw, draw_bolts(draw, plan, draw_bodies(draw, plan)))
            if draw.random() < _MIRRORED:
                spec = mirror_motor(spec)
            return _build_without_misplaced(spec)
        except ConfigError as error:
            refusal = str(error)
    raise ConfigError(f"no motor of family {family} in {_MAX_DRAWS} draws, the last: {refusal}")


def _build_without_misplaced(spec: MotorSpec) -> MotorModel:
    """Build a motor, leaving out bolts that cannot be where they were drawn."""
    while True:
        try:
            model = build_motor(spec)
        except BoltPlaceError as error:
            bolts = list(spec.bolts)
            del bolts[error.index]
            spec = spec.model_copy(update={"bolts": tuple(bolts)})
            continue
        if len(model.bolts) < _MIN_BOLTS:
            raise ConfigError(f"only {len(model.bolts)} bolts")
        return model
