"""The extension's zip, without Blender."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path

import pytest

import boltpose
from boltpose.blender.extension import pack_extension
from boltpose.errors import InputFileError


def test_the_zip_holds_a_manifest_an_entry_and_the_wheels(tmp_path: Path) -> None:
    wheel = tmp_path / "manifold3d-3.2.0-cp311-cp311-linux_x86_64.whl"
    wheel.write_bytes(b"wheel")
    target = tmp_path / "boltpose.zip"
    pack_extension(target, [wheel])
    first = target.read_bytes()
    pack_extension(target, [wheel])
    assert target.read_bytes() == first
    with zipfile.ZipFile(target) as archive:
        assert archive.namelist() == [
            "blender_manifest.toml", "__init__.py", f"wheels/{wheel.name}",
        ]  # fmt: skip
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        compile(archive.read("__init__.py"), "__init__.py", "exec")
    assert manifest["version"] == boltpose.__version__
    assert manifest["blender_version_min"] == "4.2.0"
    assert manifest["wheels"] == [f"./wheels/{wheel.name}"]
    # Blender's rules for taglines and permissions
    for text in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(text) <= 64
        assert text[-1].isalnum()


@pytest.mark.parametrize("name", ["numpy-2.0.0-cp311-cp311-linux_x86_64.whl", "notes.txt"])
def test_what_blender_ships_or_is_no_wheel_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputFileError, match=r"Blender ships|no wheel"):
        pack_extension(tmp_path / "boltpose.zip", [tmp_path / name])
    assert not (tmp_path / "boltpose.zip").exists()
