import numpy as np
import pytest

from boltpose.errors import EmptyScanError
from boltpose.evaluation import hard_scenes
from boltpose.evaluation.hard_scenes import HardScene
from tests.unit.evaluation.hard_samples import scene


@pytest.fixture(scope="module")
def whole() -> HardScene:
    return scene()


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_the_stand_in_for_the_network_answers_in_any_order(whole: HardScene) -> None:
    scan = whole.scan()
    assert scan.pixels is not None
    truth = whole.is_motor[scan.pixels[:, 0], scan.pixels[:, 1]]
    order = rng().permutation(len(scan))

    found = whole.predictor.predict(scan.points[order])

    np.testing.assert_array_equal(found > 0.5, truth[order])


@pytest.mark.parametrize("share", [0.8, 0.95])
def test_a_plate_hides_its_share_and_hangs_before_the_motor(whole, share: float) -> None:
    hidden = hard_scenes.hide(whole, share, rng())

    assert hidden.is_motor.sum() == pytest.approx((1 - share) * whole.is_motor.sum(), rel=0.05)
    plate = whole.is_motor & ~hidden.is_motor
    assert hidden.depth_mm[plate].max() < whole.depth_mm[whole.is_motor].min() - 20.0


def test_a_picture_that_ends_keeps_its_share_and_nothing_beyond(whole) -> None:
    cut = hard_scenes.cut_at_border(whole, 0.2, rng())

    assert cut.is_motor.sum() == pytest.approx(0.2 * whole.is_motor.sum(), rel=0.1)
    assert not (cut.is_motor & (cut.depth_mm == 0)).any()


def test_dropout_loses_its_share_of_depth(whole) -> None:
    lost = hard_scenes.drop_out(whole, 0.75, rng())

    assert (lost.depth_mm > 0).sum() == pytest.approx(0.25 * (whole.depth_mm > 0).sum(), rel=0.3)
    assert not (lost.is_motor & (lost.depth_mm == 0)).any()


def test_a_mirrored_mirror_is_the_view_itself(whole) -> None:
    twice = hard_scenes.mirror(hard_scenes.mirror(whole))

    np.testing.assert_array_equal(twice.depth_mm, whole.depth_mm)
    np.testing.assert_allclose(twice.camera_matrix, whole.camera_matrix)
    assert hard_scenes.mirror(whole).camera_from_prior is None


def test_a_mirrored_scan_has_the_mirrored_points(whole) -> None:
    mirrored = hard_scenes.mirror(whole).scan().points * (-1.0, 1.0, 1.0)
    points = whole.scan().points

    np.testing.assert_allclose(
        mirrored[np.lexsort(mirrored.T)], points[np.lexsort(points.T)], atol=1e-9
    )


def test_an_empty_clamp_shows_no_motor_and_takes_something_else_for_it(whole) -> None:
    empty = hard_scenes.take_motor_out(whole, rng())

    assert not (empty.depth_mm[whole.is_motor] > 0).any()
    assert empty.is_motor.any()
    assert not (empty.is_motor & whole.is_motor).any()
    assert empty.camera_from_prior is None


def test_a_second_motor_stands_beside_the_first(whole) -> None:
    two = hard_scenes.add_motor(whole, whole)

    added = two.is_motor & ~whole.is_motor
    assert added.sum() > 500
    # it may not hide the first one
    np.testing.assert_array_equal(two.depth_mm[whole.is_motor], whole.depth_mm[whole.is_motor])


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_a_spoiled_mask_holds_its_share_of_clamp_in_one_patch(whole, share: float) -> None:
    spoiled = hard_scenes.spoil_mask(whole, share, rng())

    wrong = spoiled.is_motor & ~whole.is_motor
    assert wrong.sum() / spoiled.is_motor.sum() == pytest.approx(share, rel=0.1)
    assert (spoiled.is_motor & whole.is_motor).sum() == whole.is_motor.sum()


def test_a_shrunk_mask_lost_its_share(whole) -> None:
    shrunk = hard_scenes.shrink_mask(whole, 0.3, rng())

    assert shrunk.is_motor.sum() == pytest.approx(0.7 * whole.is_motor.sum(), rel=0.05)


def test_no_depth_is_no_scan(whole) -> None:
    from dataclasses import replace

    with pytest.raises(EmptyScanError, match="made up has no depth"):
        replace(whole, depth_mm=np.zeros_like(whole.depth_mm)).scan()
