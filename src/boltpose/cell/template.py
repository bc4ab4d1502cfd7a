"""The settings file that `boltpose config init` writes: every key, commented out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from boltpose.cell.file import COMMAND_LINE_ONLY

_HEAD = """\
# Settings of one robot cell for boltpose; `boltpose config check` reads and tests all of it.
# A line without # in front counts. Lengths in mm; paths are relative to this file.
# The command line wins over this file. docs/cli.md says what each key means.
"""
_EXAMPLES = {
    ("locate", "prior"): '"motor.prior.npz"    # or a folder: which motor is it?',
    ("locate", "hand_eye"): '"hand_eye.yaml"',
    ("locate", "hand_eye_sigma"): "[0.2, 0.02]    # mm, degrees",
    ("locate", "camera"): '"scene_camera.json"    # of depth images only',
    ("locate", "models"): '"networks"    # by default the shipped ones',
    ("locate", "tool_tolerance"): "[0.4, 1.0, 2.0]    # mm beside, mm along, degrees",
    ("robot", "tcp"): '"flange_from_tool.yaml"    # poses of the flange instead of the tool',
    (
        "robot",
        "workspace_mm",
    ): "[400, 800, -300, 300, 50, 400]    # x from, to, y, z of heads",
    ("robot", "min_tool_fits"): "0.9",
    ("robot", "max_sigma_mm"): "0.5",
    ("robot", "max_sigma_axis_deg"): "0.5",
    ("robot", "fanuc_first_register"): "10",
    ("robot", "fanuc_count_register"): "10",
    ("service", "scans"): '"scans"    # files that requests may name',
    ("service", "models"): '"networks"',
    ("service", "database"): '"postgresql+psycopg://user:word@host/name"',
}
"""Where the default is None, what a value may look like."""


def settings_template(kinds: Mapping[str, type]) -> str:
    """Write every key of every section with its default.

    Args:
        kinds: The dataclass of each section, by name.
    """
    parts = [_HEAD]
    for section, kind in kinds.items():
        lines = [f"[{section}]"]
        for field in fields(kind):
            if field.name in COMMAND_LINE_ONLY.get(section, ()):
                continue
            default = None if field.default is MISSING else field.default
            value = _EXAMPLES.get((section, field.name)) if default is None else _toml(default)
            if value is None:
                raise LookupError(f"[{section}] {field.name} has no example")
            lines.append(f"# {field.name} = {value}")
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def _toml(value: Any) -> str:
    """A default as TOML has it: numbers, words and lists are written as in JSON."""
    return json.dumps(list(value) if isinstance(value, tuple) else value)
