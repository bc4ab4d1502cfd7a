"""A folder of priors: one `.prior.npz` per motor the cell may meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from boltpose.errors import InputFileError
from boltpose.prior.file import read_prior, read_sketch
from boltpose.prior.sketch import PriorSketch
from boltpose.schema import Prior

PRIOR_PATTERN = "*.prior.npz"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PriorFolder:
    """The priors of a folder, their sketches read, their points not yet."""

    sketches: tuple[PriorSketch, ...]
    """Sorted by file name."""
    paths: Mapping[str, Path]
    """By the name of the motor, which is the one in the file, not the file's."""

    def read(self, name: str) -> Prior:
        """Read the whole prior of a name.

        Raises:
            KeyError: There is none of that name.
            InputFileError: Its file is missing or damaged by now.
        """
        return read_prior(self.paths[name])


def open_prior_folder(folder: str | Path) -> PriorFolder:
    """Read the sketches of all priors of a folder; nothing is written to it.

    One damaged file makes the folder unusable: a cell that silently forgets a motor would take a
    look-alike for it.

    Raises:
        InputFileError: There is no such folder, no prior in it, a prior cannot be read, or two
            have the same name.
    """
    place = Path(folder)
    wanted = f"a folder of {PRIOR_PATTERN} (boltpose prior build)"
    if not place.is_dir():
        raise InputFileError(place, "a file" if place.exists() else "no such folder", wanted)
    paths: dict[str, Path] = {}
    sketches: list[PriorSketch] = []
    for path in sorted(place.glob(PRIOR_PATTERN)):
        sketch = read_sketch(path)
        if sketch.name in paths:
            raise InputFileError(
                path,
                f"the name {sketch.name!r} as in {paths[sketch.name].name}",
                "another name per motor (boltpose prior build --name)",
            )
        paths[sketch.name] = path
        sketches.append(sketch)
    if not sketches:
        raise InputFileError(place, f"no {PRIOR_PATTERN}", wanted)
    return PriorFolder(sketches=tuple(sketches), paths=paths)
