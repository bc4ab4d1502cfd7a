from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from boltpose.arrays import Float32Array
from boltpose.errors import ConfigError, FrameError
from boltpose.geometry.transforms import Transform
from boltpose.locate import locate
from boltpose.registration.library import PriorLibrary
from boltpose.schema import Check, LocateResult, Prior, Scan, Status
from boltpose.variants import VariantConfig, locate_variant
from tests.unit.registration.scenes import back_wall, motor_prior, pose, pose_error, view

TRUTH = pose(turn=(0.4, 1.9, 0.3))
SCALES = (0.85, 0.93, 1.0, 1.08)
RIGHT = motor_prior(1.0).name


class InFront:
    """Takes what stands before the wall for the motor."""

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        return (np.asarray(points_camera)[:, 2] < 790.0).astype(np.float32)


@pytest.fixture(scope="module")
def scan() -> Scan:
    return Scan(points=view(TRUTH)[0])


@pytest.fixture(scope="module")
def priors() -> list[Prior]:
    return [motor_prior(scale) for scale in SCALES]


@pytest.fixture(scope="module")
def library(priors: list[Prior]) -> PriorLibrary:
    return PriorLibrary.from_priors(priors)


@pytest.fixture(scope="module")
def result(scan: Scan, library: PriorLibrary) -> LocateResult:
    return locate_variant(scan, library, None, InFront())


def test_the_motor_found_is_located_as_if_it_had_been_given(
    scan: Scan, result: LocateResult
) -> None:
    found = result
    given = locate(scan, motor_prior(1.0), None, InFront())

    assert found.is_ok
    assert found.prior_name == RIGHT
    assert found.registration is not None
    assert given.registration is not None
    assert pose_error(found.registration.camera_from_prior, TRUTH) < 0.1
    np.testing.assert_array_equal(
        found.registration.camera_from_prior.matrix, given.registration.camera_from_prior.matrix
    )
    assert [bolt.id for bolt in found.bolts] == [bolt.id for bolt in given.bolts]
    for one, other in zip(found.bolts, given.bolts, strict=True):
        np.testing.assert_array_equal(one.frame_from_bolt.matrix, other.frame_from_bolt.matrix)


def test_all_compared_are_told_best_first_and_clearly_behind(result: LocateResult) -> None:
    scores = [variant.score for variant in result.variants]
    assert result.variants[0].name == RIGHT
    assert result.variants[0].status is Status.OK
    assert result.variants[0].p_correct == result.verdict.p_correct
    assert len(result.variants) == len(SCALES)
    assert scores == sorted(scores, reverse=True)
    assert all(variant.status is Status.REFUSED for variant in result.variants[1:])
    lead = result.verdict.scores["variant_lead"]
    assert lead == scores[0] - scores[1] > VariantConfig().min_lead


def test_neither_the_order_of_the_priors_nor_what_is_in_memory_matters(
    scan: Scan, priors: list[Prior], result: LocateResult
) -> None:
    # nothing prepared yet
    again = locate_variant(scan, priors[::-1], None, InFront())

    assert again.variants == result.variants
    assert again.verdict == result.verdict
    assert again.provenance == result.provenance


def test_an_unknown_motor_is_refused_and_the_nearest_are_named(
    scan: Scan, priors: list[Prior]
) -> None:
    others = [prior for prior in priors if prior.name != RIGHT]

    result = locate_variant(scan, others, None, InFront())

    assert not result.is_ok
    assert not result.bolts
    assert result.verdict.failed[0] is Check.UNKNOWN_MOTOR
    assert result.verdict.reasons[0].startswith("none of 3 known motors fits; nearest: made up")
    assert len(result.verdict.failed) > 1
    assert result.registration is not None
    assert result.prior_name == result.variants[0].name


def test_two_that_fit_alike_are_refused_by_name(scan: Scan, priors: list[Prior]) -> None:
    twin = replace(motor_prior(1.0), name="twin")

    result = locate_variant(scan, [*priors, twin], None, InFront())

    assert not result.is_ok
    assert not result.bolts
    assert result.verdict.failed == (Check.UNKNOWN_MOTOR,)
    assert "cannot be told apart" in result.verdict.reasons[0]
    assert "twin" in result.verdict.reasons[0]
    assert RIGHT in result.verdict.reasons[0]
    assert [v.status for v in result.variants[:2]] == [Status.OK, Status.OK]


def test_one_prior_is_enough(scan: Scan) -> None:
    result = locate_variant(scan, [motor_prior(1.0)], None, InFront())
    assert result.is_ok
    assert "variant_lead" not in result.verdict.scores
    assert not locate_variant(scan, [motor_prior(0.85)], None, InFront()).is_ok


@pytest.mark.parametrize("count", [0, 5, 200])
def test_without_a_motor_no_motor_is_called_unknown(library: PriorLibrary, count: int) -> None:
    motor = view(TRUTH)[0][:count]
    scan = Scan(points=np.vstack([motor, back_wall()]))

    result = locate_variant(scan, library, None, InFront())

    assert not result.is_ok
    assert Check.UNKNOWN_MOTOR not in result.verdict.failed
    assert result.verdict.failed[0] in (Check.NO_MOTOR, Check.TOO_FEW_POINTS)
    assert result.registration is None


def test_wrong_arguments_are_named(scan: Scan, priors: list[Prior]) -> None:
    with pytest.raises(ConfigError, match="at least one prior, got none"):
        locate_variant(scan, [], None, InFront())
    with pytest.raises(FrameError, match="got camera_from_base"):
        locate_variant(scan, priors, Transform.identity("camera", "base"), InFront())
    with pytest.raises(ConfigError, match="full_tries must be >= 1, got 0"):
        VariantConfig(full_tries=0)
    with pytest.raises(ConfigError, match=r"min_agreement must be in \(0, 1\), got 0"):
        VariantConfig(min_agreement=0)
    with pytest.raises(ConfigError, match=r"min_lead must be in \(0, 1\), got 1"):
        VariantConfig(min_lead=1)
