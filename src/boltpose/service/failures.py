"""What a client is told when its request cannot be done: a stable code and one line."""

from __future__ import annotations

from boltpose.errors import (
    BoltposeError,
    ConfigError,
    EmptyScanError,
    InputFileError,
    MissingExtraError,
    UnitError,
)


class ServiceError(BoltposeError):
    """A request that is answered with an HTTP error."""

    def __init__(
        self, status: int, code: str, message: str, *, retry_after_s: int | None = None
    ) -> None:
        """Keep what the client is told.

        Args:
            status: HTTP status.
            code: Stable word for programs.
            message: One line for people: what was found, what was wanted.
            retry_after_s: When to come again, for header `Retry-After`.
        """
        super().__init__(" ".join(message.split()))
        self.status = status
        self.code = code
        self.retry_after_s = retry_after_s


def bad_request(message: str) -> ServiceError:
    """The request itself is malformed."""
    return ServiceError(400, "bad_request", message)


def bad_setting(message: str) -> ServiceError:
    """A field of the request has a value that cannot be used."""
    return ServiceError(422, "bad_setting", message)


def journal_failed() -> ServiceError:
    """What cannot be written down is not done, and not answered."""
    return ServiceError(
        503,
        "journal_failed",
        "the journal cannot be read or written, so nothing is answered; see the service's log",
        retry_after_s=5,
    )


def as_failure(error: BoltposeError) -> ServiceError:
    """Turn an error of the library, caused by the request's input, into an answer."""
    if isinstance(error, ServiceError):
        return error
    status, code = 422, "bad_input"
    if isinstance(error, UnitError):
        code = "wrong_unit"
    elif isinstance(error, InputFileError):
        code = "bad_file"
    elif isinstance(error, EmptyScanError):
        code = "too_few_points"
    elif isinstance(error, ConfigError):
        code = "bad_setting"
    elif isinstance(error, MissingExtraError):
        status, code = 501, "not_installed"
    return ServiceError(status, code, str(error))
