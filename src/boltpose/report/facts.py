"""The small print for engineers and auditors: timings, versions, hashes, settings, other motors."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from boltpose.locate_config import LocateConfig
from boltpose.registration.joint import JointConfig
from boltpose.report.markup import Html, clip, join, number, tag
from boltpose.schema import LocateResult, Status
from boltpose.variant_search import VariantConfig

_HASH_LENGTH = 12
_SHOWN_VARIANTS = 5
_SHOWN_SETTINGS = 12
_NO_POSE = frozenset({"config.label_scan"})
"""Settings that change no number of a result."""


def fact_section(result: LocateResult, timings_ms: Mapping[str, float] | None) -> Html:
    """Lay out where a result came from."""
    provenance = result.provenance
    rows = [
        ("Time", _timings(timings_ms or {})),
        ("Version", join(["boltpose ", str(provenance.get("version", "not noted"))])),
        ("Inputs", _inputs(provenance)),
        ("Networks", _networks(provenance.get("models"))),
        ("Settings", _settings(provenance)),
        ("Motors tried", _variants(result)),
    ]
    return tag(
        "section",
        tag("h2", "Where this comes from"),
        tag("dl", *(tag("div", tag("dt", name), tag("dd", text)) for name, text in rows if text)),
        class_="facts",
    )


def changed_settings(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Settings that differ from the defaults of this version.

    Args:
        provenance: Of a result.

    Returns:
        Dotted name and value as JSON, in the order of the settings.
    """
    found: list[tuple[str, str]] = []
    for name, defaults in (
        ("config", LocateConfig()),
        ("joint", JointConfig()),
        ("variants", VariantConfig()),
    ):
        given = provenance.get(name)
        if isinstance(given, Mapping):
            plain = json.loads(json.dumps(asdict(defaults)))
            found += _differences(name, given, plain)
    return [(name, text) for name, text in found if name not in _NO_POSE]


def _differences(
    name: str, given: Mapping[str, Any], default: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    for key, value in given.items():
        if key not in default:
            # `variants` also notes what was found; a setting this version lacks is in `config`
            if name.startswith("config"):
                yield f"{name}.{key}", _as_json(value)
            continue
        known = default[key]
        plain = json.loads(_as_json(value))
        if isinstance(plain, dict) and isinstance(known, dict):
            yield from _differences(f"{name}.{key}", plain, known)
        elif plain != known:
            yield f"{name}.{key}", _as_json(value)


def _timings(timings_ms: Mapping[str, float]) -> Html | None:
    if not timings_ms:
        return None
    stages = [f"{stage} {number(value, 0)} ms" for stage, value in timings_ms.items()]
    total = number(sum(timings_ms.values()) / 1000, 2)
    return join([tag("strong", f"{total} s"), " = ", " + ".join(stages)])


def _inputs(provenance: Mapping[str, Any]) -> Html | None:
    parts: list[Html] = []
    for what in ("scan", "prior", "hand_eye", "robot_pose"):
        digests = provenance.get(f"{what}_sha256")
        names = provenance.get(what)
        for row, digest in enumerate(digests if isinstance(digests, list) else [digests]):
            if not isinstance(digest, str):
                continue
            named = names[row] if isinstance(names, list) and row < len(names) else names
            shown = f" {clip(str(named), 40)}" if isinstance(named, str) else ""
            parts.append(join([f"{what.replace('_', '-')}{shown} ", _digest(digest)]))
    unit = provenance.get("inputs")
    if isinstance(unit, Mapping) and isinstance(unit.get("scan_unit"), str):
        parts.append(join([f"scan unit {unit['scan_unit']}"]))
    return join(parts, "; ") if parts else None


def _networks(models: object) -> Html | None:
    if not isinstance(models, Mapping) or not models:
        return None
    return join(
        (join([f"{clip(str(name), 40)} ", _digest(str(value))]) for name, value in models.items()),
        "; ",
    )


def _settings(provenance: Mapping[str, Any]) -> Html:
    if not isinstance(provenance.get("config"), Mapping):
        return join(["not noted"])
    changed = changed_settings(provenance)
    if not changed:
        return join(["all as by default"])
    shown = [f"{name} = {clip(text, 60)}" for name, text in changed[:_SHOWN_SETTINGS]]
    more = len(changed) - len(shown)
    if more > 0:
        shown.append(f"and {more} more (see poses.json)")
    return join([tag("strong", "not the defaults: "), "; ".join(shown)])


def _variants(result: LocateResult) -> Html | None:
    if not result.variants:
        return None
    shown = [
        join(
            [
                clip(entry.name, 40),
                f" {number(max(entry.score, 0.0), 2)}",
                " (accepted)" if entry.status is Status.OK else None,
            ]
        )
        for entry in result.variants[:_SHOWN_VARIANTS]
    ]
    more = len(result.variants) - len(shown)
    if more > 0:
        shown.append(join([f"and {more} more"]))
    return join(["agreement 0 to 1, best first: ", join(shown, "; ")])


def _digest(text: str) -> Html:
    return tag("code", clip(text, _HASH_LENGTH + 1), title=text)


def _as_json(value: object) -> str:
    return json.dumps(value, sort_keys=True, default=str)
