import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.evaluation.decoys import mirror_scan
from boltpose.evaluation.object_search import SearchConfig, prior_of_object, search_object
from boltpose.registration.prepare import prepare_prior
from boltpose.schema import Scan, Status
from tests.unit.registration.scenes import motor_prior, pose, pose_error, visible_points

CONFIG = SearchConfig(spacing_mm=1000.0, ball_share=1.5)  # one place: the middle of the scan
POSE = pose(turn=(0.6, -0.4, 0.9))


def test_an_object_is_found_where_it_is_and_its_mirror_image_is_not() -> None:
    prepared = prepare_prior(prior_of_object(motor_prior().points, "toy"))
    scan = Scan(points=visible_points(POSE, step=1.0))

    found = search_object(prepared, scan, CONFIG)

    assert [finding.verdict.status for finding in found.findings] == [Status.OK]
    assert found.votes == (1,)
    assert pose_error(found.poses[0], POSE) < 0.3

    mirrored = search_object(prepared, mirror_scan(scan), CONFIG)

    assert mirrored.poses == ()
    assert [finding.verdict.status for finding in mirrored.findings] == [Status.REFUSED]


def test_a_prior_of_an_object_has_outward_normals_and_no_bolts() -> None:
    known = motor_prior()
    prior = prior_of_object(known.points, "toy")

    assert prior.bolts == ()
    agree = np.einsum("ni,ni->n", prior.normals, known.normals)
    assert (agree > 0.5).mean() > 0.95


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigError, match="ball_share must be > 0, got 0"):
        SearchConfig(ball_share=0)
    with pytest.raises(ConfigError, match="min_points must be >= 3, got 1"):
        SearchConfig(min_points=1)
