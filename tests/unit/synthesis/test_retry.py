from __future__ import annotations

import pytest

from boltpose.errors import DegenerateGeometryError, MissingExtraError
from boltpose.synthesis.retry import MAX_ATTEMPTS, InfeasibleSampleError, draw_until_built


def test_the_first_draw_that_can_be_built_is_kept_with_the_reasons_before() -> None:
    def draw(attempt: int) -> int:
        if attempt < 2:
            raise DegenerateGeometryError(f"no room {attempt}")
        return attempt

    drawn = draw_until_built("motor", draw)
    assert (drawn.result, drawn.attempt) == (2, 2)
    assert drawn.retries == (
        "DegenerateGeometryError: no room 0",
        "DegenerateGeometryError: no room 1",
    )


def test_after_many_draws_it_ends_with_the_last_reason() -> None:
    tried: list[int] = []

    def draw(attempt: int) -> int:
        tried.append(attempt)
        raise ValueError("empty")

    with pytest.raises(InfeasibleSampleError, match=r"motor_00003: .* ValueError: empty"):
        draw_until_built("motor_00003", draw)
    assert tried == list(range(MAX_ATTEMPTS))


@pytest.mark.parametrize("error", [MissingExtraError("embreex", "synth"), KeyError("a fault")])
def test_what_trying_again_cannot_help_is_passed_on_at_once(error: Exception) -> None:
    def draw(attempt: int) -> int:
        assert attempt == 0
        raise error

    with pytest.raises(type(error)):
        draw_until_built("motor", draw)
