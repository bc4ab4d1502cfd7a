"""API keys: made once, shown once, kept only as salted hashes."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
import stat
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from boltpose.errors import ConfigError, InputFileError
from boltpose.io.atomic import write_atomic

KEY_FILE = "keys.json"
_SCRYPT_N = 2**14
_SCRYPT_R = 8
_MAX_KEY_LETTERS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredKey:
    """What is kept of a key."""

    id: str
    """Part of the key itself; no secret."""
    name: str
    """Whom it was given to; is written into the journal."""
    salt: str
    """Hexadecimal."""
    scrypt: str
    """Hexadecimal hash of the whole key."""
    created: str
    """UTC."""


class KeyRing:
    """The keys of one service.

    A key that was accepted is remembered by a fast hash with a secret of this process: scrypt,
    slow on purpose, runs once per key and not once per request.
    """

    def __init__(self, data: Path) -> None:
        """Open the keys of a service's data folder.

        Raises:
            InputFileError: The file of keys is damaged.
        """
        self.path = data / KEY_FILE
        self._keys = _read_keys(self.path)
        self._secret = secrets.token_bytes(32)
        self._accepted: dict[bytes, StoredKey] = {}

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def keys(self) -> tuple[StoredKey, ...]:
        """What is stored, without secrets."""
        return tuple(self._keys.values())

    def add(self, name: str) -> str:
        """Make a key and keep its hash.

        Args:
            name: Whom it is for.

        Returns:
            The key. It cannot be had a second time.

        Raises:
            ConfigError: The name is empty or too long.
        """
        name = " ".join(name.split())
        if not 1 <= len(name) <= 100:
            raise ConfigError("a key needs a name of 1 to 100 letters: who is it for?")
        key_id = secrets.token_hex(4)
        key = f"bp_{key_id}_{secrets.token_urlsafe(32)}"
        salt = secrets.token_bytes(16)
        stored = StoredKey(
            id=key_id,
            name=name,
            salt=salt.hex(),
            scrypt=_hash(key, salt).hex(),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
        )
        self._write({**self._keys, key_id: stored})
        return key

    def remove(self, key_id: str) -> StoredKey:
        """Forget a key; a running service does so when it is started again.

        Raises:
            ConfigError: There is no such key.
        """
        if key_id not in self._keys:
            raise ConfigError(f"no key '{key_id}', there are: {', '.join(self._keys) or 'none'}")
        removed = self._keys[key_id]
        self._write({other: key for other, key in self._keys.items() if other != key_id})
        return removed

    def check(self, key: str) -> StoredKey | None:
        """Return what is stored of a valid key, None for any other text.

        Slow (50 ms) for a key not seen before: call it outside the event loop.
        """
        if not key.isascii() or len(key) > _MAX_KEY_LETTERS:
            return None
        mark = hmac.digest(self._secret, key.encode(), "sha256")
        for known, stored in self._accepted.items():
            if hmac.compare_digest(known, mark):
                return stored
        parts = key.split("_", 2)
        stored = self._keys.get(parts[1]) if len(parts) == 3 and parts[0] == "bp" else None
        if stored is None:
            return None
        found = _hash(key, bytes.fromhex(stored.salt))
        if not hmac.compare_digest(found, bytes.fromhex(stored.scrypt)):
            return None
        self._accepted[mark] = stored
        return stored

    def _write(self, keys: dict[str, StoredKey]) -> None:
        text = json.dumps({"keys": [asdict(key) for key in keys.values()]}, indent=2) + "\n"

        def write(stream: BinaryIO) -> None:
            stream.write(text.encode())

        old_mask = os.umask(0o077)
        try:
            write_atomic(self.path, write)
        finally:
            os.umask(old_mask)
        self._keys = keys
        self._accepted.clear()


def _hash(key: str, salt: bytes) -> bytes:
    return hashlib.scrypt(key.encode(), salt=salt, n=_SCRYPT_N, r=_SCRYPT_R, p=1, dklen=32)


def _read_keys(path: Path) -> dict[str, StoredKey]:
    wanted = "a file of `boltpose serve --new-key`"
    if not path.exists():
        return {}
    if os.name == "posix" and stat.S_IMODE(path.stat().st_mode) & 0o022:
        raise InputFileError(path, "a file that others can change", f"mode 600: chmod 600 {path}")
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))["keys"]
        keys = [StoredKey(**entry) for entry in entries]
        for key in keys:
            bytes.fromhex(key.salt)
            bytes.fromhex(key.scrypt)
    except (OSError, ValueError, KeyError, TypeError) as error:
        # never taken for "no keys": that would open the service
        raise InputFileError(path, f"damaged keys ({type(error).__name__})", wanted) from error
    return {key.id: key for key in keys}
