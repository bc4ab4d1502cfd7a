"""The one form in which errors are answered."""

from __future__ import annotations

from typing import Any

from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict

from boltpose.service.failures import ServiceError


class ErrorText(BaseModel):
    """What went wrong."""

    model_config = ConfigDict(extra="forbid")
    code: str
    """Stable word for programs."""
    message: str
    """One line for people."""
    request: str | None = None
    """Id in the journal, if it came that far."""


class ErrorAnswer(BaseModel):
    """Body of every answer with a status of 400 and above."""

    model_config = ConfigDict(extra="forbid")
    error: ErrorText


_RETRY_AFTER = {"schema": {"type": "integer"}, "description": "Seconds to wait"}

ERRORS: dict[int | str, dict[str, Any]] = {
    status: {
        "model": ErrorAnswer,
        "description": text,
        **({"headers": {"Retry-After": _RETRY_AFTER}} if status in (429, 503) else {}),
    }
    for status, text in {
        400: "Malformed request",
        401: "API key missing or wrong",
        403: "Not allowed from here",
        404: "No such thing",
        405: "No such method",
        408: "The upload took too long",
        409: "In conflict with what is there",
        413: "Too large",
        415: "Another kind of content",
        422: "Input that cannot be used",
        429: "Queue full; see Retry-After",
        500: "A mistake of the service",
        501: "Not installed",
        503: "Not ready, or waited too long",
        504: "The computation took too long",
        507: "The service's disk is full",
    }.items()
}
"""For OpenAPI; every route may answer these."""


def error_answer(error: ServiceError, request: str | None = None) -> JSONResponse:
    """Turn an error into its answer."""
    body: dict[str, Any] = {"code": error.code, "message": str(error), "request": request}
    headers: dict[str, str] = {}
    if error.retry_after_s is not None:
        headers["Retry-After"] = str(error.retry_after_s)
    if error.status == 401:
        headers["WWW-Authenticate"] = "Bearer"
    if error.status in (408, 413):
        # the rest of the body is not read
        headers["Connection"] = "close"
    return JSONResponse({"error": body}, status_code=error.status, headers=headers)
