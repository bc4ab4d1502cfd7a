from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.prior.sketch import PriorSketch, sketch_prior
from boltpose.registration.align_many import AlignRound
from boltpose.registration.library import PriorLibrary
from boltpose.registration.shortlist import (
    ShortlistConfig,
    ViewSketch,
    align_all,
    build_shortlist_index,
    compare_closely,
    rank_by_pairs,
    sketch_view,
)
from boltpose.schema import Prior
from tests.unit.registration.scenes import motor_prior, pose, pose_error, visible_points

TRUTH = pose(turn=(0.4, 1.9, 0.3))
SCALES = (0.8, 0.9, 1.0, 1.15, 1.3)
RIGHT = SCALES.index(1.0)
TRUTH_MOTOR = TRUTH @ Transform.identity("prior", "motor")
CONFIG = ShortlistConfig()


@pytest.fixture(scope="module")
def sketches() -> list[PriorSketch]:
    return [sketch_prior(motor_prior(scale)) for scale in SCALES]


@pytest.fixture(scope="module")
def view() -> ViewSketch:
    sketch = sketch_view(visible_points(TRUTH), CONFIG)
    assert sketch is not None
    return sketch


def near(shift_mm: float, turn_rad: float) -> Transform:
    turn = Rotation.from_rotvec((0.0, turn_rad, 0.0)).as_matrix()
    beside = Transform.from_parts("prior", "motor", turn, (shift_mm, 0.0, -shift_mm))
    return TRUTH @ beside


def test_the_right_size_comes_first_from_a_pose_that_is_off(
    sketches: list[PriorSketch], view: ViewSketch
) -> None:
    aligned = align_all(build_shortlist_index(sketches), view, [near(4.0, 0.05)])

    assert sorted(prior.row for prior in aligned) == list(range(len(SCALES)))
    assert aligned[0].row == RIGHT
    assert aligned[0].agreement > aligned[1].agreement + 0.1
    assert pose_error(aligned[0].camera_from_prior, TRUTH) < 1.0


def test_a_wrong_guess_beside_a_good_one_does_no_harm(
    sketches: list[PriorSketch], view: ViewSketch
) -> None:
    index = build_shortlist_index(sketches)
    flipped = TRUTH @ Transform("prior", "motor", np.diag([1.0, -1.0, -1.0, 1.0]))

    alone = align_all(index, view, [near(4.0, 0.05)])
    both = align_all(index, view, [flipped, near(4.0, 0.05)])

    assert both[0].row == alone[0].row
    np.testing.assert_array_equal(
        both[0].camera_from_prior.matrix, alone[0].camera_from_prior.matrix
    )


def test_what_is_known_of_one_prior_does_not_depend_on_the_others(
    sketches: list[PriorSketch], view: ViewSketch
) -> None:
    together = {a.row: a for a in align_all(build_shortlist_index(sketches), view, [TRUTH_MOTOR])}
    for row, sketch in enumerate(sketches):
        (alone,) = align_all(build_shortlist_index([sketch]), view, [TRUTH_MOTOR])
        assert alone.agreement == pytest.approx(together[row].agreement, abs=1e-3)


def test_those_beyond_the_first_round_stay_behind(
    sketches: list[PriorSketch], view: ViewSketch
) -> None:
    few = replace(CONFIG, kept=2)
    aligned = align_all(build_shortlist_index(sketches), view, [TRUTH_MOTOR], few)

    assert aligned[0].row == RIGHT
    assert all(rest.agreement <= aligned[1].agreement for rest in aligned[2:])


def test_on_their_full_surface_the_right_size_is_clearly_ahead(view: ViewSketch) -> None:
    priors = [motor_prior(scale) for scale in SCALES]
    agreement = compare_closely(priors, [near(1.0, 0.01)] * len(priors), view)

    assert agreement.argmax() == RIGHT
    assert agreement[RIGHT] > 0.8
    assert np.delete(agreement, RIGHT).max() < 0.5


def test_pairs_name_every_prior_once(sketches: list[PriorSketch], view: ViewSketch) -> None:
    order = rank_by_pairs(build_shortlist_index(sketches), view)
    assert sorted(order) == list(range(len(SCALES)))


def test_too_few_points_make_no_sketch() -> None:
    assert sketch_view(np.zeros((0, 3)), CONFIG) is None
    assert sketch_view(visible_points(TRUTH)[:10], CONFIG) is None


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: ShortlistConfig(kept=0), "kept must be >= 1, got 0"),
        (lambda: ShortlistConfig(unknown_share=1.0), r"unknown_share must be in \(0, 1\), got 1"),
        (lambda: ShortlistConfig(voxel_mm=float("nan")), "voxel_mm must be > 0, got nan"),
        (
            lambda: AlignRound(points=9, steps=0, distance_mm=(2.0, 1.0), tolerance_mm=1.0),
            "got 9, 0 and 1.0",
        ),
        (
            lambda: AlignRound(points=9, steps=1, distance_mm=(1.0, 2.0), tolerance_mm=1.0),
            "got 1.0 to 2.0",
        ),
    ],
)
def test_settings_out_of_range_are_named(make: Callable[[], object], match: str) -> None:
    with pytest.raises(ConfigError, match=match):
        make()


def test_a_library_is_sorted_and_wants_different_names() -> None:
    small, large = motor_prior(0.8), motor_prior(1.3)

    assert PriorLibrary.from_priors([large, small]).names == (small.name, large.name)
    with pytest.raises(ConfigError, match="at least one prior, got none"):
        PriorLibrary.from_priors([])
    with pytest.raises(ConfigError, match="different names, got more than one 'made up"):
        PriorLibrary.from_priors([small, large, small])


def test_a_library_reads_what_it_is_asked_for_and_keeps_the_last() -> None:
    asked: list[str] = []
    priors = {motor_prior(scale).name: motor_prior(scale) for scale in SCALES[:3]}

    def read(name: str) -> Prior:
        asked.append(name)
        return priors[name]

    sketches = [sketch_prior(prior) for prior in priors.values()]
    library = PriorLibrary(sketches, read, kept=2)
    assert not asked
    for row in (0, 1, 0, 2, 0, 1):
        assert library.prior(row).name == library.names[row]
    assert asked == [library.names[row] for row in (0, 1, 2, 1)]
