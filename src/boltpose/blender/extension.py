"""The add-on as an extension of Blender 4.2 and later: one zip, to be dropped into Blender.

`python -m boltpose.blender.extension boltpose-blender.zip WHEEL...` packs it. The wheels are
boltpose's own and those of the packages it needs there; without any, Blender's Python must have
them already.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from boltpose import __version__
from boltpose.blender import bl_info
from boltpose.errors import InputFileError
from boltpose.io.atomic import write_atomic

_MANIFEST = """schema_version = "1.0.0"
id = "boltpose"
version = "{version}"
name = "boltpose starter motors"
tagline = "{tagline}"
maintainer = "boltpose developers"
type = "add-on"
tags = ["Add Mesh"]
blender_version_min = "{blender}"
license = ["SPDX:Apache-2.0"]
wheels = [{wheels}]

[permissions]
files = "Read a motor's specification, write exported motors"
"""

_ENTRY = '''"""Forwards to the add-on in the package boltpose."""

from boltpose.blender import register, unregister

__all__ = ["register", "unregister"]
'''

_BLENDERS_OWN = ("numpy-", "bpy-")
"""Wheels that would replace what Blender ships and is built against."""
_LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""All files of the zip carry this date, so that the same input gives the same bytes."""


def pack_extension(target: Path, wheels: Sequence[Path] = ()) -> None:
    """Write the zip that `Preferences > Get Extensions > Install from Disk` takes.

    Args:
        target: The zip; replaced if it is there.
        wheels: Packages to take along, for the platform and Python of that Blender.

    Raises:
        InputFileError: A wheel is missing, is no wheel, or would replace what Blender ships.
        OSError: The zip cannot be written.
    """
    for wheel in wheels:
        if wheel.suffix != ".whl" or not wheel.is_file():
            raise InputFileError(wheel, "no wheel", "a file that ends in .whl")
        if wheel.name.startswith(_BLENDERS_OWN):
            raise InputFileError(wheel, "a package that Blender ships", "any other wheel")
    manifest = _MANIFEST.format(
        version=__version__,
        tagline=str(bl_info["description"])[:64],
        blender=".".join(map(str, _blender_version())),
        wheels=", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels),
    )
    files = {
        "blender_manifest.toml": manifest.encode(),
        "__init__.py": _ENTRY.encode(),
        **{f"wheels/{wheel.name}": wheel.read_bytes() for wheel in wheels},
    }

    def write(stream: BinaryIO) -> None:
        with zipfile.ZipFile(stream, "w") as archive:
            for name, data in files.items():
                archive.writestr(zipfile.ZipInfo(name, _LONG_AGO), data, zipfile.ZIP_DEFLATED)

    write_atomic(target, write)


def _blender_version() -> tuple[int, ...]:
    """The oldest Blender that the add-on runs in."""
    version = bl_info["blender"]
    assert isinstance(version, tuple)
    return version


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m boltpose.blender.extension OUT.zip WHEEL...")
    pack_extension(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
