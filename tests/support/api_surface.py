"""Every public name of the package's top level with its signature or fields.

`python -m tests.support.api_surface` writes `tests/api_surface.json` again; its diff is what
users of the library will notice.
"""

from __future__ import annotations

import dataclasses
import enum
import inspect
import json
from pathlib import Path
from typing import Any

import boltpose

PATH = Path(__file__).resolve().parents[1] / "api_surface.json"


def describe_api() -> dict[str, Any]:
    """Name to a JSON-ready description."""
    return {name: _describe(getattr(boltpose, name)) for name in sorted(boltpose.__all__)}


def _describe(value: Any) -> Any:
    if inspect.isclass(value):
        if issubclass(value, enum.Enum):
            return {"enum": {member.name: member.value for member in value}}
        if dataclasses.is_dataclass(value):
            return {"fields": {field.name: str(field.type) for field in dataclasses.fields(value)}}
        return {"class": [base.__name__ for base in value.__mro__[1:-1]]}
    if callable(value):
        return {"signature": str(inspect.signature(value))}
    return {"value": type(value).__name__}


if __name__ == "__main__":
    PATH.write_text(json.dumps(describe_api(), indent=1, sort_keys=True) + "\n", encoding="utf-8")
