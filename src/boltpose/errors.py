"""Every error this package raises on purpose; each is also the fitting builtin."""

from __future__ import annotations

from pathlib import Path


class BoltposeError(Exception):
    """Base of all errors raised on purpose; its text is one line a user can act on."""


class ShapeError(BoltposeError, ValueError):
    """An array has the wrong shape, dtype or holds values that are not finite."""


class FrameError(BoltposeError, ValueError):
    """Transforms or points of different frames were mixed, or a matrix is no rigid motion."""


class DegenerateGeometryError(BoltposeError, ValueError):
    """The geometry does not determine what was asked for."""


class EmptyScanError(BoltposeError, ValueError):
    """Too few points to work with."""


class ConfigError(BoltposeError, ValueError):
    """A setting is unknown or out of its range."""


class MissingExtraError(BoltposeError, ImportError):
    """An optional package is needed; the text holds the install line."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"this needs {package}: pip install 'boltpose[{extra}]'")


class InputFileError(BoltposeError, ValueError):
    """A file cannot be used; the text names it, what was found and what was wanted."""

    def __init__(self, path: str | Path, found: str, wanted: str) -> None:
        super().__init__(f"{path}: found {found}, wanted {wanted}")
        self.path = Path(path)
        self.found = found
        self.wanted = wanted


class UnitError(InputFileError):
    """The size of the data says that its unit is not millimetres."""


class PosesRefusedError(BoltposeError, ValueError):
    """There is no pose that a robot may follow; the text says why."""
