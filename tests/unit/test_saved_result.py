"""A `poses.json` opened again is what it was, or it is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.io.digest import sha256_of
from boltpose.prior.file import write_prior
from boltpose.results import dump_json, to_file, write_poses
from boltpose.saved_result import open_saved_result, result_of
from boltpose.schema import BoltState, ExtraHead, LocateResult, Prior, Status, VariantScore
from tests.support import results


def everything(prior: Prior) -> LocateResult:
    """A result with every field that a file may hold."""
    plain = results.located(prior)
    first, second, *rest = plain.bolts
    return replace(
        plain,
        bolts=(
            replace(first, name="upper", tool="hex 8", order=2, p_tool_fits=0.7),
            replace(second, state=BoltState.CONTRADICTED, state_reason="a hole is there"),
            *rest,
        ),
        extra_heads=(
            ExtraHead(head_top_mm=np.array([1.0, 2.0, 3.0]), diameter_mm=9.0, height_mm=4.0),
        ),
        variants=(
            VariantScore(name="cube", status=Status.OK, p_correct=0.9, score=0.8),
            VariantScore(name="ball", status=Status.REFUSED, p_correct=0.0, score=-np.inf),
        ),
    )


@pytest.mark.parametrize("kind", ["ok", "camera", "refused", "no candidate"])
def test_the_file_of_what_was_read_is_the_file(kind: str) -> None:
    prior = results.cube_prior()
    result = {
        "ok": lambda: everything(prior),
        "camera": lambda: results.located(prior, None),
        "refused": lambda: results.refused(prior),
        "no candidate": lambda: results.refused(prior, has_candidate=False),
    }[kind]()
    again = result_of(to_file(result))
    assert dump_json(again) == dump_json(result)
    assert again.is_ok == result.is_ok


def save(folder: Path, **changes: Any) -> Path:
    """A scan, a prior and a result of them, as `boltpose locate` leaves them."""
    folder.mkdir(parents=True, exist_ok=True)
    prior = results.cube_prior()
    scan = results.cube_scan(prior)
    write_prior(folder / "cube.prior.npz", prior)
    np.savez(folder / "scan.npz", points=scan.points)
    provenance = {
        "scan_sha256": sha256_of(folder / "scan.npz"),
        "prior_sha256": sha256_of(folder / "cube.prior.npz"),
        "inputs": {
            "scans": [str(folder / "scan.npz")],
            "scan_unit": "mm",
            "camera": None,
            "prior": str(folder / "cube.prior.npz"),
        },
        **changes,
    }
    result = replace(results.located(prior), provenance=provenance)
    write_poses(folder / "poses.json", result, {"registration": 12.0})
    return folder / "poses.json"


def test_scan_and_prior_come_along(tmp_path: Path) -> None:
    saved = open_saved_result(save(tmp_path))
    assert saved.prior.name == "cube"
    assert len(saved.scan) == len(results.cube_scan(results.cube_prior()))
    assert saved.timings_ms == {"registration": 12.0}
    assert saved.result.is_ok


def test_a_folder_may_be_moved_as_a_whole(tmp_path: Path) -> None:
    save(tmp_path / "line")
    (tmp_path / "line").rename(tmp_path / "archive")
    saved = open_saved_result(tmp_path / "archive" / "poses.json")
    assert Path(saved.scan.source).parent == tmp_path / "archive"


@pytest.mark.parametrize("name", ["scan.npz", "cube.prior.npz"])
def test_other_bytes_than_those_it_was_made_from_are_refused(tmp_path: Path, name: str) -> None:
    poses = save(tmp_path)
    with (tmp_path / name).open("ab") as stream:
        stream.write(b"\0")
    with pytest.raises(InputFileError, match=f"{name}: found another file"):
        open_saved_result(poses)


def test_what_is_gone_is_asked_for_by_its_option(tmp_path: Path) -> None:
    poses = save(tmp_path)
    (tmp_path / "scan.npz").rename(tmp_path / "renamed.npz")
    with pytest.raises(InputFileError, match=r"scan\.npz: .*--scan FILE"):
        open_saved_result(poses)
    assert len(open_saved_result(poses, tmp_path / "renamed.npz").scan)


def test_a_file_without_a_note_of_its_inputs_says_so(tmp_path: Path) -> None:
    poses = save(tmp_path, inputs=None)
    with pytest.raises(InputFileError, match="no note of where the scan is"):
        open_saved_result(poses)
    assert open_saved_result(poses, tmp_path / "scan.npz", tmp_path / "cube.prior.npz").prior.bolts


def test_of_several_scans_the_one_the_pose_is_about(tmp_path: Path) -> None:
    poses = save(tmp_path)
    other = tmp_path / "other.npz"
    np.savez(other, points=np.random.default_rng(0).normal(size=(500, 3)) * 100 + [0, 0, 600])
    provenance = json.loads(poses.read_text())["provenance"]
    provenance["inputs"]["scans"].insert(0, str(other))
    hashes = [sha256_of(other), provenance["scan_sha256"]]
    changes = provenance | {"scan_sha256": hashes, "reference_view": "scan.npz"}
    poses = save(tmp_path, **changes)
    assert open_saved_result(poses).scan.source.endswith("scan.npz")


def test_a_folder_of_priors_holds_the_one_that_was_found(tmp_path: Path) -> None:
    poses = save(tmp_path, prior_sha256=None)
    assert open_saved_result(poses, prior=tmp_path).prior.name == "cube"


def test_a_folder_that_has_lost_or_changed_the_prior_is_told(tmp_path: Path) -> None:
    poses = save(tmp_path)
    write_prior(tmp_path / "cube.prior.npz", replace(results.cube_prior(), provenance={"a": 1}))
    with pytest.raises(InputFileError, match=r"cube\.prior\.npz: found another file"):
        open_saved_result(poses, prior=tmp_path)
    write_prior(tmp_path / "cube.prior.npz", replace(results.cube_prior(), name="ball"))
    with pytest.raises(InputFileError, match="no prior of the name 'cube'"):
        open_saved_result(poses, prior=tmp_path)
