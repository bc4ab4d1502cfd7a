"""Random draws that cannot be built are drawn again, from a seed derived from theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from boltpose.errors import BoltposeError, MissingExtraError

Result = TypeVar("Result")

MAX_ATTEMPTS = 12
"""One draw in some hundred fails; twelve in a row are a fault of the generator."""


class InfeasibleSampleError(BoltposeError, RuntimeError):
    """Not one of many draws could be built."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn(Generic[Result]):
    """A draw that could be built."""

    result: Result
    attempt: int
    """0 if the first one could."""
    retries: tuple[str, ...]
    """Why earlier ones could not."""


def draw_until_built(what: str, draw: Callable[[int], Result]) -> Drawn[Result]:
    """Call `draw` with attempt 0, 1 ... until it does not raise.

    Args:
        what: For the error text, for example `motor_00012`.
        draw: Draws and builds; the same attempt gives the same result.

    Returns:
        The first result, and why there was none before.

    Raises:
        InfeasibleSampleError: `MAX_ATTEMPTS` draws failed.
        MissingExtraError: A package is missing; trying again would not help.
    """
    retries: list[str] = []
    for attempt in range(MAX_ATTEMPTS):
        try:
            result = draw(attempt)
        except MissingExtraError:
            raise
        except (BoltposeError, ValueError) as error:
            # what a body that vanished or a clamp that does not fit raise
            retries.append(f"{type(error).__name__}: {error}")
            continue
        return Drawn(result=result, attempt=attempt, retries=tuple(retries))
    raise InfeasibleSampleError(
        f"{what}: {MAX_ATTEMPTS} draws could not be built, the last one because of {retries[-1]}"
    )
