"""A motor in a clamp on a table: which clamps there are, and how a motor gets into one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.factory.clamps.assembly import Assembly, ClampBody, InfeasibleError, turn_about_z
from boltpose.factory.clamps.chucks import build_tilted_chuck, build_vertical_chuck
from boltpose.factory.clamps.clutter import scatter_clutter
from boltpose.factory.clamps.contact import BoxedBody, boxed, cut_nests, overlap_depth_mm
from boltpose.factory.clamps.cradles import build_strap_cradle, build_tilted_cradle
from boltpose.factory.clamps.flange import build_flange_plate
from boltpose.factory.clamps.plates import make_ground
from boltpose.factory.clamps.supports import build_centres, build_pin_fixture
from boltpose.factory.clamps.v_blocks import build_v_blocks
from boltpose.factory.clamps.vices import build_parallel_vice, build_prism_vice
from boltpose.factory.clamps.workpiece import Workpiece, inspect_motor
from boltpose.factory.model import MotorModel, SceneModel, SolidPart
from boltpose.factory.solids import Manifold, manifold_of, solid_part
from boltpose.factory.viewpoint import preferred_direction, suggest_camera
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

__all__ = [
    "CLAMPS",
    "MAX_INTERPENETRATION_MM",
    "interpenetration_mm",
    "place_motor",
    "preferred_direction",
    "suggest_camera",
]

_BUILDERS: dict[str, Callable[[Workpiece, np.random.Generator], Assembly]] = {
    "v_blocks": build_v_blocks,
    "parallel_vice": build_parallel_vice,
    "prism_vice": build_prism_vice,
    "vertical_chuck": build_vertical_chuck,
    "tilted_chuck": build_tilted_chuck,
    "strap_cradle": build_strap_cradle,
    "tilted_cradle": build_tilted_cradle,
    "flange_plate": build_flange_plate,
    "pin_fixture": build_pin_fixture,
    "centres": build_centres,
}

CLAMPS: tuple[str, ...] = tuple(_BUILDERS)
"""Names of all clamp designs."""

MAX_INTERPENETRATION_MM = 0.5
"""Deeper than this no clamp may go into a motor."""

MAX_ATTEMPTS = 60
"""Tries of a design that was asked for, before it is said not to fit; most succeed within three.

Where any design will do, the next one is taken after an eighth of them."""


def place_motor(
    model: MotorModel, rng: np.random.Generator, clamp: str | None = None
) -> SceneModel:
    """Clamp a motor in a random feasible pose, on a base plate, with clutter around.

    Args:
        model: The motor, frame `motor`.
        rng: Source of all choices.
        clamp: One of `CLAMPS`; by default one at random that fits.

    Returns:
        The scene, frame `table`. Clamp and motor touch and go into each other by no more than
        `MAX_INTERPENETRATION_MM`.

    Raises:
        ConfigError: There is no such clamp.
        DegenerateGeometryError: The motor does not fit the clamp, or, if none was asked for, any.
    """
    if clamp is not None and clamp not in _BUILDERS:
        raise ConfigError(f"no clamp '{clamp}', there are {', '.join(CLAMPS)}")
    work = inspect_motor(model)
    motor = [manifold_of(part) for part in model.parts]
    names = [clamp] if clamp else [str(name) for name in rng.permutation(CLAMPS)]
    reasons: list[str] = []
    for name in names:
        for _ in range(MAX_ATTEMPTS if clamp else MAX_ATTEMPTS // 8):
            try:
                return _try_clamp(work, motor, name, rng)
            except InfeasibleError as error:
                reasons.append(str(error))
    wanted = f"clamp '{clamp}'" if clamp else "any clamp"
    raise DegenerateGeometryError(
        f"motor '{model.spec.name}' does not fit {wanted} in {len(reasons)} attempts; "
        f"last: {reasons[-1]}"
    )


def interpenetration_mm(scene: SceneModel) -> float:
    """How deep any solid of the background goes into any part of the motor.

    It is measured on the surfaces of the overlaps, see `contact.overlap_depth_mm`.
    """
    groups: tuple[list[BoxedBody], list[BoxedBody]] = ([], [])
    for solid in scene.solids:
        groups[solid.part != Part.BACKGROUND].append(boxed(manifold_of(solid)))
    return overlap_depth_mm(*groups)


def _try_clamp(
    work: Workpiece, motor: Sequence[Manifold], name: str, rng: np.random.Generator
) -> SceneModel:
    """One attempt with one design."""
    assembly = _BUILDERS[name](work, rng)
    # most fixtures stand square on their plate, some do not
    yaw = 90.0 * rng.integers(4) + (rng.normal(0, 2) if rng.random() < 0.7 else rng.uniform(0, 90))
    turned = assembly.moved(Transform("table", "table", turn_about_z(float(yaw))))
    pose = turned.table_from_motor
    if work.posed(pose).lowest() < 1:
        raise InfeasibleError("the motor would stand in the base plate")
    parts = [boxed(body.transform(np.ascontiguousarray(pose.matrix[:3]))) for body in motor]
    nested = cut_nests(turned.bodies, parts)
    if nested.touching < 2:
        raise InfeasibleError("the clamp does not hold the motor")
    clamp = [boxed(piece.body) for piece in nested.bodies]
    if overlap_depth_mm(clamp, parts) > MAX_INTERPENETRATION_MM:
        raise InfeasibleError("clamp and motor go into each other")
    standing = [*clamp, *parts]
    reach = np.max([np.maximum(-box.low, box.high) for box in standing], axis=0)
    ground = make_ground(rng, float(reach[0]), float(reach[1]))
    clutter = scatter_clutter(rng, ground, standing)
    bodies = [*nested.bodies, *ground.bodies, *clutter]
    return SceneModel(
        clamp_name=name,
        solids=(
            *(_background(piece) for piece in bodies),
            *(part.moved(pose) for part in work.model.parts),
        ),
        table_from_motor=pose,
    )


def _background(piece: ClampBody) -> SolidPart:
    """Freeze a piece; whatever it looks like, its class is background."""
    return solid_part(piece.body, f"background_{piece.name}", Part.BACKGROUND, piece.material)
