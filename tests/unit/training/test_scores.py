from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.training.scores import confusion_matrix, score_confusion

labels = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2)), min_size=1, max_size=60)


@given(labels)
def test_scores_are_what_sets_of_points_say(pairs: list[tuple[int, int]]) -> None:
    truth, guess = np.array(pairs).T
    scores = score_confusion(confusion_matrix(truth, guess, 3), ["a", "b", "c"])
    assert scores.overall_accuracy == pytest.approx(np.mean(truth == guess))
    assert scores.points == len(pairs)
    for number, name in enumerate("abc"):
        union = ((truth == number) | (guess == number)).sum()
        if union:
            both = ((truth == number) & (guess == number)).sum()
            assert scores.iou[name] == pytest.approx(both / union)
        else:
            assert name not in scores.iou
    assert scores.mean_iou == pytest.approx(np.mean(list(scores.iou.values())))


def test_nothing_cannot_be_scored() -> None:
    with pytest.raises(ValueError, match="at least one point"):
        score_confusion(np.zeros((2, 2), dtype=np.int64), ["a", "b"])


def test_every_class_needs_a_name() -> None:
    with pytest.raises(ValueError, match="1 x 1"):
        score_confusion(np.eye(2, dtype=np.int64), ["a"])
