from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import EmptyScanError, InputFileError
from boltpose.geometry.point_pairs import PAIR_WORDS
from boltpose.prior.file import read_sketch, write_prior
from boltpose.prior.sketch import SKETCH_POINTS, PriorSketch, sketch_prior
from boltpose.schema import Part
from tests.support import records


def rewrite(path: Path, **changes: np.ndarray | None) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    for name, array in changes.items():
        if array is None:
            del arrays[name]
        else:
            arrays[name] = array
    np.savez(path, **arrays)


def assert_same(first: PriorSketch, second: PriorSketch) -> None:
    assert first.name == second.name
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.normals, second.normals)
    np.testing.assert_array_equal(first.pairs, second.pairs)
    np.testing.assert_array_equal(first.prior_from_motor.matrix, second.prior_from_motor.matrix)


def test_its_points_are_points_of_the_prior_in_the_motors_axes_without_the_cable() -> None:
    prior = records.prior()

    sketch = sketch_prior(prior)

    rigid = prior.points[prior.labels != Part.ELECTRICAL_CONNECTOR]
    back = sketch.prior_from_motor.apply(sketch.points)
    away = np.linalg.norm(back[:, None] - rigid[None], axis=2).min(axis=1)
    assert away.max() < 1e-4
    assert 0 < len(sketch.points) <= min(SKETCH_POINTS, len(rigid))
    assert sketch.pairs.shape == (PAIR_WORDS,)
    assert sketch.pairs.sum() == pytest.approx(1.0, abs=1e-5)


def test_the_file_holds_the_sketch_and_older_files_give_the_same(tmp_path: Path) -> None:
    prior = records.prior()
    path = tmp_path / "m.prior.npz"
    write_prior(path, prior)
    assert_same(read_sketch(path), sketch_prior(prior))

    rewrite(path, sketch_version=None, sketch_surface=None, sketch_pairs=None)
    assert_same(read_sketch(path), sketch_prior(prior))


def test_of_another_version_nothing_is_taken(tmp_path: Path) -> None:
    prior = records.prior()
    path = tmp_path / "m.prior.npz"
    write_prior(path, prior)
    rewrite(path, sketch_version=np.array(0), sketch_surface=np.zeros(3))
    assert_same(read_sketch(path), sketch_prior(prior))


@pytest.mark.parametrize(
    "change",
    [
        {"sketch_surface": np.zeros((5, 5), dtype=np.float32)},
        {"sketch_surface": np.full((5, 6), np.nan, dtype=np.float32)},
        {"sketch_pairs": np.zeros(3, dtype=np.float32)},
    ],
)
def test_a_damaged_sketch_is_named(tmp_path: Path, change: dict[str, np.ndarray]) -> None:
    path = tmp_path / "m.prior.npz"
    write_prior(path, records.prior())
    rewrite(path, **change)
    with pytest.raises(InputFileError, match=r"m\.prior\.npz: found a damaged sketch"):
        read_sketch(path)


def test_a_prior_of_nothing_rigid_is_written_but_has_no_sketch(tmp_path: Path) -> None:
    prior = records.prior()
    cable = np.full(len(prior.points), int(Part.ELECTRICAL_CONNECTOR), dtype=np.uint8)
    prior = replace(prior, labels=cable)
    with pytest.raises(EmptyScanError, match="found 0 rigid points, wanted at least 2"):
        sketch_prior(prior)
    write_prior(tmp_path / "m.prior.npz", prior)
    with pytest.raises(InputFileError, match="0 rigid points"):
        read_sketch(tmp_path / "m.prior.npz")
