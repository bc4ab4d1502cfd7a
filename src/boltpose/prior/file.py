"""The `.prior.npz` file: a Prior on disk, readable by numpy alone, nothing unpickled."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from boltpose.errors import BoltposeError, EmptyScanError, InputFileError
from boltpose.geometry.point_pairs import PAIR_WORDS
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.io.guard import require_file
from boltpose.io.npz import refuse_huge_arrays
from boltpose.prior.sketch import SKETCH_VERSION, PriorSketch, sketch_prior
from boltpose.schema import Alignment, Part, Prior, PriorBolt, Side

FORMAT = "boltpose.prior/1"
_ARRAYS: dict[str, tuple[str, int]] = {"points": ("f", 3), "normals": ("f", 3), "labels": ("u", 0)}
_WANTED = "a prior written by `boltpose prior build`"


def write_prior(path: str | Path, prior: Prior) -> None:
    """Write a prior; the file appears whole or not at all.

    Points and normals are stored as float32 (rounding below 1e-5 mm on a motor). The file also
    holds the prior's sketch, by which `locate` finds one motor among many.

    Raises:
        InputFileError: The file cannot be written there.
    """
    arrays: dict[str, Any] = {
        "header": np.array(json.dumps(prior_to_json(prior), sort_keys=True)),
        "points": prior.points.astype(np.float32),
        "normals": prior.normals.astype(np.float32),
        "labels": prior.labels,
        **_sketch_arrays(prior),
    }

    def write(stream: BinaryIO) -> None:
        np.savez_compressed(stream, **arrays)

    write_atomic(Path(path), write)


def read_prior(path: str | Path) -> Prior:
    """Read a prior written by `write_prior`.

    Raises:
        InputFileError: The file is missing, damaged, or no prior of a known version.
    """
    header, arrays = _read_archive(path, tuple(_ARRAYS))
    _check_arrays(path, arrays)
    try:
        return _prior_from_json(header, arrays)
    except (KeyError, TypeError, ValueError, BoltposeError) as error:
        raise InputFileError(path, f"a damaged header ({error!r})", _WANTED) from error


def read_sketch(path: str | Path) -> PriorSketch:
    """Read what tells a prior from others, without its points where the file allows it.

    A file written before there were sketches, or by another version of them, is read whole and
    its sketch made anew (0.3 s).

    Raises:
        InputFileError: The file is missing, damaged, or no prior of a known version.
    """
    header, arrays = _read_archive(path, ("sketch_version", "sketch_surface", "sketch_pairs"))
    version, surface = arrays.get("sketch_version"), arrays.get("sketch_surface")
    pairs = arrays.get("sketch_pairs")
    if version is None or surface is None or pairs is None or int(version) != SKETCH_VERSION:
        try:
            return sketch_prior(read_prior(path))
        except EmptyScanError as error:
            raise InputFileError(path, str(error), _WANTED) from error
    is_sound = (
        surface.dtype == pairs.dtype == np.float32
        and surface.ndim == 2
        and surface.shape[1] == 6
        and pairs.shape == (PAIR_WORDS,)
        and bool(np.isfinite(surface).all() and np.isfinite(pairs).all())
    )
    if not is_sound:
        raise InputFileError(path, "a damaged sketch", _WANTED)
    try:
        return PriorSketch(
            name=str(header["name"]),
            points=surface[:, :3],
            normals=surface[:, 3:],
            pairs=pairs,
            prior_from_motor=Transform(
                "prior", "motor", np.array(header["alignment"]["prior_from_motor"])
            ),
        )
    except (KeyError, TypeError, ValueError, BoltposeError) as error:
        raise InputFileError(path, f"a damaged header ({error!r})", _WANTED) from error


def _sketch_arrays(prior: Prior) -> dict[str, np.ndarray[Any, Any]]:
    try:
        sketch = sketch_prior(prior)
    except EmptyScanError:
        return {}  # nothing to tell it by; it still is a file that can be read
    return {
        "sketch_version": np.array(SKETCH_VERSION),
        "sketch_surface": np.hstack([sketch.points, sketch.normals]),
        "sketch_pairs": sketch.pairs,
    }


def _read_archive(
    path: str | Path, names: tuple[str, ...]
) -> tuple[Mapping[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Header and those of the named arrays that are there; only they are unpacked."""
    try:
        refuse_huge_arrays(require_file(path, _WANTED))
        # a name is opened by us: numpy would leave it open when the archive is damaged
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile) or "header" not in archive:
                raise InputFileError(path, "no prior header", _WANTED)
            header = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in names if name in archive}
    except InputFileError:
        raise
    except (
        OSError,
        ValueError,
        EOFError,
        KeyError,
        MemoryError,  # a header that claims more than its array holds
        zlib.error,
        zipfile.BadZipFile,
    ) as error:
        raise InputFileError(
            path, f"no readable archive ({type(error).__name__})", _WANTED
        ) from error
    found = header.get("format") if isinstance(header, dict) else None
    if found != FORMAT:
        raise InputFileError(path, f"format {found!r}", f"'{FORMAT}': build the prior again")
    return header, arrays


def prior_to_json(prior: Prior) -> dict[str, Any]:
    """Everything of a prior but its point arrays, JSON-ready; lengths mm, angles rad."""
    alignment = prior.alignment
    return {
        "format": FORMAT,
        "name": prior.name,
        "unit": "mm",
        "bolts": [_bolt_to_json(bolt) for bolt in prior.bolts],
        "alignment": {
            "prior_from_motor": alignment.prior_from_motor.matrix.tolist(),
            "axis_spread_rad": alignment.axis_spread_rad,
            "axis_sigma_rad": alignment.axis_sigma_rad,
            "normal_count": alignment.normal_count,
            "inlier_ratio": alignment.inlier_ratio,
            "has_solenoid": alignment.has_solenoid,
        },
        "provenance": dict(prior.provenance),
    }


def _check_arrays(path: str | Path, arrays: Mapping[str, np.ndarray[Any, Any]]) -> None:
    for name, (kind, columns) in _ARRAYS.items():
        array = arrays.get(name)
        if array is None:
            raise InputFileError(path, f"no array '{name}'", _WANTED)
        shape = (len(arrays["points"]), columns) if columns else (len(arrays["points"]),)
        if array.dtype.kind != kind or array.shape != shape:
            raise InputFileError(
                path, f"'{name}' of {array.dtype} {array.shape}", f"kind '{kind}' {shape}"
            )
        if kind == "f" and not np.isfinite(array).all():
            raise InputFileError(path, f"values in '{name}' that are not finite", _WANTED)
    if len(arrays["labels"]) and int(arrays["labels"].max()) > max(Part):
        raise InputFileError(path, f"label {arrays['labels'].max()}", f"0 to {max(Part)}")


def _bolt_to_json(bolt: PriorBolt) -> dict[str, Any]:
    return {
        "id": bolt.id,
        "side": str(bolt.side),
        "prior_from_bolt": bolt.prior_from_bolt.matrix.tolist(),
        "cluster_centre": bolt.cluster_centre.tolist(),
        "head_diameter_mm": bolt.head_diameter_mm,
        "head_height_mm": bolt.head_height_mm,
        "point_count": bolt.point_count,
        "class_probability": bolt.class_probability,
        "head_fit_support": bolt.head_fit_support,
        "sigma_lateral_mm": bolt.sigma_lateral_mm,
        "sigma_axial_mm": bolt.sigma_axial_mm,
        "confidence": bolt.confidence,
        "is_sure": bolt.is_sure,
        "remarks": list(bolt.remarks),
        "name": bolt.name,
        "tool": bolt.tool,
        "order": bolt.order,
    }


def _bolt_from_json(data: Mapping[str, Any]) -> PriorBolt:
    return PriorBolt(
        id=str(data["id"]),
        side=Side(data["side"]),
        prior_from_bolt=Transform("prior", "bolt", np.array(data["prior_from_bolt"])),
        cluster_centre=np.array(data["cluster_centre"], dtype=np.float64).reshape(3),
        head_diameter_mm=float(data["head_diameter_mm"]),
        head_height_mm=float(data["head_height_mm"]),
        point_count=int(data["point_count"]),
        class_probability=float(data["class_probability"]),
        head_fit_support=float(data["head_fit_support"]),
        sigma_lateral_mm=float(data["sigma_lateral_mm"]),
        sigma_axial_mm=float(data["sigma_axial_mm"]),
        # older files state none
        confidence=float(data.get("confidence", data["class_probability"])),
        is_sure=bool(data["is_sure"]),
        remarks=tuple(str(remark) for remark in data["remarks"]),
        # nor these
        name=str(data.get("name", "")),
        tool=str(data.get("tool", "")),
        order=None if data.get("order") is None else int(data["order"]),
    )


def _prior_from_json(
    header: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]
) -> Prior:
    alignment = header["alignment"]
    return Prior(
        name=str(header["name"]),
        points=arrays["points"].astype(np.float64),
        normals=arrays["normals"].astype(np.float64),
        labels=arrays["labels"].astype(np.uint8),
        bolts=tuple(_bolt_from_json(bolt) for bolt in header["bolts"]),
        alignment=Alignment(
            prior_from_motor=Transform("prior", "motor", np.array(alignment["prior_from_motor"])),
            axis_spread_rad=float(alignment["axis_spread_rad"]),
            axis_sigma_rad=float(alignment["axis_sigma_rad"]),
            normal_count=int(alignment["normal_count"]),
            inlier_ratio=float(alignment["inlier_ratio"]),
            has_solenoid=bool(alignment["has_solenoid"]),
        ),
        provenance=dict(header["provenance"]),
    )
