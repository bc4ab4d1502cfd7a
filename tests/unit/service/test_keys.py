"""Keys are kept as hashes only, and a damaged file never opens the service."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from boltpose.errors import ConfigError, InputFileError
from boltpose.service.keys import KEY_FILE, KeyRing


def test_a_key_opens_and_only_that_key(tmp_path: Path) -> None:
    ring = KeyRing(tmp_path)
    key = ring.add("robot 1")
    again = KeyRing(tmp_path)
    for _ in range(2):  # hashed the first time, remembered the second
        stored = again.check(key)
        assert stored is not None
        assert stored.name == "robot 1"
    for wrong in (key[:-1], key + "x", key.swapcase(), "", "bp__", "bp_00000000_x", "ä", "x" * 999):
        assert again.check(wrong) is None


def test_the_file_holds_no_key_and_is_private(tmp_path: Path) -> None:
    key = KeyRing(tmp_path).add("robot 1")
    path = tmp_path / KEY_FILE
    assert key.split("_", 2)[2] not in path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_two_keys_have_different_salts(tmp_path: Path) -> None:
    ring = KeyRing(tmp_path)
    ring.add("a")
    ring.add("b")
    assert len({entry.salt for entry in ring.keys}) == 2
    assert len({entry.scrypt for entry in ring.keys}) == 2


def test_a_removed_key_opens_no_more(tmp_path: Path) -> None:
    ring = KeyRing(tmp_path)
    key = ring.add("a")
    stored = ring.check(key)
    assert stored is not None
    ring.remove(stored.id)
    assert ring.check(key) is None
    with pytest.raises(ConfigError, match="no key"):
        ring.remove(stored.id)


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_keys_that_others_can_add_to_open_nothing(tmp_path: Path, mode: int) -> None:
    KeyRing(tmp_path).add("robot 1")
    (tmp_path / KEY_FILE).chmod(mode)
    with pytest.raises(InputFileError, match="chmod 600"):
        KeyRing(tmp_path)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"keys": [{"id": 1}]}', '{"keys": 3}'])
def test_damaged_keys_are_no_missing_keys(tmp_path: Path, text: str) -> None:
    (tmp_path / KEY_FILE).write_text(text)
    with pytest.raises(InputFileError, match="damaged keys"):
        KeyRing(tmp_path)
