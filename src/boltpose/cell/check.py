"""Looks at everything a cell's settings name before production does."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from boltpose.cell.locate_section import LocateSection
from boltpose.cell.slips import tell_file_error
from boltpose.errors import BoltposeError, InputFileError
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.io.guard import require_file
from boltpose.io.hand_eye import hand_eye_error, read_hand_eye
from boltpose.prior.file import read_prior
from boltpose.prior.folder import PRIOR_PATTERN, open_prior_folder
from boltpose.schema import Prior
from boltpose.segmentation.models import load_models

_CAMERA_NUMBERS = 9
"""Of a 3 x 3 camera matrix."""


_FAR_MM = {"base": 5000.0, "flange": 1000.0}
"""Further off is hardly a camera over a robot's cell, or on its arm: inches or cm, perhaps."""


class Level(StrEnum):
    """What a check found."""

    OK = "ok"
    WARN = "warn"
    """It works, but somebody should know."""
    FAIL = "fail"
    """Production would stop there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a check says of one key of the settings."""

    section: str
    key: str
    level: Level
    text: str


def check_locate(section: LocateSection) -> Iterator[Finding]:
    """Read every file that `boltpose locate` would read; one finding or more per key.

    Args:
        section: The settings.
    """
    yield from _say("prior", lambda: _check_priors(section.prior))
    yield from _say("hand_eye", lambda: _check_hand_eye(section))
    yield from _say("models", lambda: describe_models(section.models))
    if section.camera is not None:
        camera = section.camera
        yield from _say("camera", lambda: _check_camera(camera))


def _say(key: str, check: Callable[[], Iterable[tuple[Level, str]]]) -> Iterator[Finding]:
    try:
        found = tuple(check())
    except InputFileError as error:
        # the text is that of the command line
        found = ((Level.FAIL, tell_file_error(error).replace("--hand-eye-unit", "hand_eye_unit")),)
    except (BoltposeError, OSError) as error:
        found = ((Level.FAIL, str(error)),)
    for level, text in found:
        yield Finding(section="locate", key=key, level=level, text=text)


def _check_priors(path: Path | None) -> Iterator[tuple[Level, str]]:
    if path is None:
        yield Level.WARN, "not set: every locate needs --prior"
        return
    if not path.is_dir():
        yield _describe_prior(path.name, read_prior(path))
        return
    shelf = open_prior_folder(path)
    yield Level.OK, f"{len(shelf.sketches)} priors ({PRIOR_PATTERN}) in {path}"
    for sketch in shelf.sketches:
        yield _describe_prior(sketch.name, shelf.read(sketch.name))


def _describe_prior(what: str, prior: Prior) -> tuple[Level, str]:
    unsure = [bolt.id for bolt in prior.bolts if not bolt.is_sure]
    if not prior.bolts:
        return Level.FAIL, f"{what}: no bolts in it"
    if unsure:
        return (
            Level.WARN,
            f"{what}: {len(prior.bolts)} bolts, nobody has confirmed {', '.join(unsure)} "
            "(boltpose prior review)",
        )
    return Level.OK, f"{what}: {len(prior.bolts)} bolts, all sure"


def _check_hand_eye(section: LocateSection) -> Iterator[tuple[Level, str]]:
    if section.hand_eye is None:
        yield Level.WARN, "not set: poses are in frame 'camera' unless --hand-eye is given"
        return
    target = "base"
    try:
        found = read_hand_eye(section.hand_eye, unit=section.hand_eye_unit)
    except BoltposeError:
        # that of a camera on the arm names its frames, or cannot be told from the other
        target = "flange"
        found = read_hand_eye(section.hand_eye, unit=section.hand_eye_unit, target="flange")
    yield _describe_camera(found.transform, target)
    error = hand_eye_error(found)
    if error is None and section.hand_eye_sigma is None:
        yield (
            Level.WARN,
            "no residuals in the file and no hand_eye_sigma: its error is in no sigma",
        )


def _describe_camera(target_from_camera: Transform, target: str) -> tuple[Level, str]:
    """Say where the camera is and which way it looks, for a person to compare with the cell.

    A matrix the wrong way round is as rigid as the right one, and nothing else shows it.
    """
    x, y, z = target_from_camera.translation_mm
    reach_mm = float(np.linalg.norm(target_from_camera.translation_mm))
    look = " ".join(f"{value + 0.0:.2f}" for value in np.round(target_from_camera.z_axis, 2))
    text = (
        f"{target}_from_camera: the camera is {reach_mm:.0f} mm off the {target}, "
        f"at {x:.0f} {y:.0f} {z:.0f}, and looks along {look}"
    )
    if reach_mm == 0 and rotation_angle_rad(target_from_camera.rotation) == 0:
        return Level.WARN, f"{text}; the identity, so `{target}` would be the camera itself"
    if reach_mm > _FAR_MM[target]:
        return Level.WARN, f"{text}; that is far, is hand_eye_unit right?"
    return Level.OK, f"{text}; is that so?"


def describe_models(folder: Path | None) -> Iterator[tuple[Level, str]]:
    """Load networks; says which they are.

    Raises:
        InputFileError: They cannot be used.
    """
    models = load_models(folder)
    names = ", ".join(f"{name} {digest[:12]}" for name, digest in sorted(models.hashes.items()))
    yield Level.OK, f"{'shipped' if folder is None else folder}: {names}"


def _check_camera(path: Path) -> Iterator[tuple[Level, str]]:
    wanted = "scene_camera.json: one object per image with cam_K, 9 numbers"
    try:
        data = json.loads(require_file(path, wanted).read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputFileError(path, f"no JSON ({error})", wanted) from error
    entries = list(data.values()) if isinstance(data, dict) else []
    are_cameras = [
        isinstance(entry, dict) and len(entry.get("cam_K", ())) == _CAMERA_NUMBERS
        for entry in entries
    ]
    if not entries or not all(are_cameras):
        raise InputFileError(path, f"{are_cameras.count(False)} entries without cam_K", wanted)
    yield Level.OK, f"{len(entries)} images"
