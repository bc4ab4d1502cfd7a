"""The motor on somebody's bench: from a specification written by hand to its model and prior."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import ValidationError

from boltpose.errors import BoltposeError, ConfigError, InputFileError
from boltpose.factory.spec import MotorSpec
from boltpose.io.atomic import write_atomic
from boltpose.io.guard import require_file
from boltpose.synthesis.write import ply_bytes

_WANTED = "a specification as `boltpose synth spec` writes it"
_MAX_BYTES = 5_000_000
_PREFIX = re.compile(r"^(Input|String|Value|Tuple) should (be )?|^Value error, ")
"""How pydantic begins its complaints."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenModel:
    """What `write_model` has written."""

    files: tuple[Path, ...]
    prior: Path
    bolt_count: int
    part_count: int


def read_spec(path: str | Path) -> MotorSpec:
    """Read a specification.

    Raises:
        InputFileError: The file is missing, no JSON, or a field is unknown or out of its range;
            the text names the field, what was found and what was wanted.
    """
    file = require_file(path, _WANTED)
    if file.stat().st_size > _MAX_BYTES:
        raise InputFileError(file, "more than 5 MB", _WANTED)
    try:
        document: Any = json.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as error:
        raise InputFileError(file, f"no readable JSON ({error})", _WANTED) from error
    try:
        return MotorSpec.model_validate(document)
    except ValidationError as error:
        raise _shortened(file, error) from error


def example_spec(family: str | None, seed: int) -> MotorSpec:
    """Draw a specification to start from.

    Args:
        family: One of `boltpose.factory.families.FAMILIES`; None for any.
        seed: Another seed, another motor.

    Raises:
        ConfigError: There is no such family.
    """
    from boltpose.factory.families import FAMILIES, sample_motor

    if family is not None and family not in FAMILIES:
        raise ConfigError(f"family must be one of {', '.join(FAMILIES)}; got '{family}'")
    return sample_motor(np.random.default_rng(seed), family)


def write_spec(path: Path, spec: MotorSpec) -> None:
    """Write a specification as JSON; the file appears whole or not at all."""

    def write(stream: BinaryIO) -> None:
        stream.write(spec.model_dump_json(indent=1).encode() + b"\n")

    write_atomic(path, write)


def write_model(spec: MotorSpec, folder: Path) -> WrittenModel:
    """Build a motor and write its meshes, labels, bolts and prior.

    Files appear when all are made: a specification that cannot be built leaves none.

    Args:
        spec: The motor.
        folder: Made if missing; files of an earlier model of that name are replaced.

    Raises:
        BoltposeError: The motor cannot be built; the text says why.
        OSError: The folder is not writable.
    """
    from boltpose.factory.build import build_motor
    from boltpose.factory.export import export_model, model_prior
    from boltpose.prior.file import write_prior

    try:
        model = build_motor(spec)
    except BoltposeError:
        raise
    except ValueError as error:
        raise ConfigError(f"'{spec.name}' cannot be built: {error}") from error
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".", suffix=".part") as place:
        made = Path(place)
        export_model(model, made)
        known = model_prior(model)
        (made / f"{spec.name}.ply").write_bytes(ply_bytes(known.points, known.labels))
        prior = f"{spec.name}.prior.npz"
        write_prior(made / prior, known)
        names = sorted(path.name for path in made.iterdir())
        for name in names:
            shutil.move(made / name, folder / name)
    return WrittenModel(
        files=tuple(folder / name for name in names),
        prior=folder / prior,
        bolt_count=len(model.bolts),
        part_count=len(model.parts),
    )


def _shortened(path: Path, error: ValidationError) -> InputFileError:
    """The first complaint in one line, with the field as it stands in the file."""
    found = error.errors()
    first = found[0]
    field = ""
    for step in first["loc"]:
        field += f"[{step}]" if isinstance(step, int) else f".{step}" if field else str(step)
    value = first["input"]
    shown = json.dumps(value, default=str)
    if first["type"] == "extra_forbidden":
        return InputFileError(path, f"the unknown field {field}", f"one of {_known(first['loc'])}")
    if first["type"] == "missing":
        return InputFileError(path, f"no {field}", "a value for it")
    text = _PREFIX.sub("", first["msg"])
    more = f" ({len(found) - 1} more)" if len(found) > 1 else ""
    return InputFileError(path, f"{field or 'the document'} = {shown[:60]}", f"{text}{more}")


def _known(place: tuple[int | str, ...]) -> str:
    """The fields of the record that a place is in."""
    schema: Any = MotorSpec.model_json_schema()
    here = schema
    for step in place[:-1]:
        here = here["items"] if isinstance(step, int) else here["properties"][step]
        for option in here.get("anyOf", [here]):
            if "$ref" in option:
                here = schema["$defs"][option["$ref"].rsplit("/", 1)[1]]
    return ", ".join(here.get("properties", {}))
