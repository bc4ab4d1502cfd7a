"""A request's fields and files -> a call whose every file is in the store."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from fastapi import Request
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException

from boltpose.errors import ConfigError
from boltpose.service.blobs import Blob, BlobStore
from boltpose.service.calls import BuildCall, LocateCall
from boltpose.service.failures import ServiceError, as_failure, bad_request, bad_setting
from boltpose.service.paths import check_prior_name, open_below, safe_name
from boltpose.service.shelf import PriorShelf

Call = TypeVar("Call")
Model = TypeVar("Model", bound=BaseModel)

MAX_FILES = 64
_MAX_FIELDS = 200
_MAX_FIELD_BYTES = 1 << 20
_MAX_JSON_BYTES = 1 << 18
_FILE_FIELDS = ("scan", "hand_eye", "robot_pose", "camera", "parts")
ALL_PRIORS = "*"
"""As `prior`: the service finds out which of its motors it is."""


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


UnitName = Literal["mm", "cm", "m", "inch"]
Text = Annotated[str, Field(min_length=1, max_length=1000)]
Texts = Annotated[list[Text], BeforeValidator(_as_list), Field(min_length=1, max_length=MAX_FILES)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]


class _Settings(BaseModel):
    """Fields that are no files."""

    model_config = ConfigDict(extra="forbid")
    prior: Annotated[
        Texts, Field(description="Name of the motor; several, or `*` for all: which one is it?")
    ]
    scan_unit: Annotated[UnitName, Field(description="Never guessed")] = "mm"
    hand_eye_unit: Annotated[UnitName, Field(description="Of hand_eye and robot_pose")] = "mm"
    hand_eye_sigma_mm: Annotated[
        Positive | None, Field(description="1 sigma of the hand-eye; else from its residuals")
    ] = None
    hand_eye_sigma_deg: Positive | None = None
    tool_lateral_mm: Annotated[
        Positive | None, Field(description="How far beside the axis the tool still grips")
    ] = None
    tool_axial_mm: Positive | None = None
    tool_angle_deg: Positive | None = None


class LocateByPath(_Settings):
    """Body of `POST /v1/locate` as JSON: files below the service's scan folder."""

    scan: Annotated[Texts, Field(description="Path of a scan; several are of one clamping")]
    hand_eye: Annotated[Texts | None, Field(description="Path, one per scan")] = None
    robot_pose: Annotated[Texts | None, Field(description="Path, one per scan")] = None
    camera: Annotated[Text | None, Field(description="Path of scene_camera.json of a .png")] = None


class BuildForm(BaseModel):
    """Fields of `POST /v1/priors` beside its files."""

    model_config = ConfigDict(extra="forbid")
    name: Annotated[str, Field(min_length=1, max_length=100)]
    unit: UnitName | None = None
    use_labels: bool = False
    replace: bool = False


_BINARY = {"type": "string", "format": "binary"}


def locate_schema() -> dict[str, Any]:
    """What OpenAPI says of the body of `POST /v1/locate`."""
    by_path = LocateByPath.model_json_schema()
    upload = _Settings.model_json_schema()
    files = {
        "scan": {"type": "array", "items": _BINARY, "minItems": 1, "maxItems": MAX_FILES},
        "hand_eye": {"type": "array", "items": _BINARY},
        "robot_pose": {"type": "array", "items": _BINARY},
        "camera": _BINARY,
    }
    fields = {**files, **upload["properties"]}
    return {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "properties": fields,
                    "required": ["scan", "prior"],
                    "additionalProperties": False,
                }
            },
            "application/json": {"schema": by_path},
        },
    }


def build_schema() -> dict[str, Any]:
    """What OpenAPI says of the body of `POST /v1/priors`."""
    fields = {"scan": _BINARY, "parts": _BINARY, **BuildForm.model_json_schema()["properties"]}
    schema = {
        "type": "object",
        "properties": fields,
        "required": ["scan", "name"],
        "additionalProperties": False,
    }
    return {"required": True, "content": {"multipart/form-data": {"schema": schema}}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Intake:
    """Where files of requests come from and go to."""

    blobs: BlobStore
    shelf: PriorShelf
    scans: Path | None
    max_bytes: int

    async def locate_call(self, request: Request) -> LocateCall:
        """Read the body of `POST /v1/locate`.

        Raises:
            ServiceError: It is malformed, too large, or names what is not there.
        """
        kind = _content_type(request)
        if kind == "application/json":
            body = _check(LocateByPath, await _read_json(request))
            return await run_in_threadpool(self._call_by_path, body)
        if kind == "multipart/form-data":
            return await _with_form(request, self._call_by_upload)
        raise _wrong_kind(kind, "multipart/form-data with files, or application/json with paths")

    async def build_call(self, request: Request) -> BuildCall:
        """Read the body of `POST /v1/priors`.

        Raises:
            ServiceError: It is malformed or too large.
        """
        kind = _content_type(request)
        if kind != "multipart/form-data":
            raise _wrong_kind(kind, "multipart/form-data")
        return await _with_form(request, self._build_by_upload)

    def _call_by_path(self, body: LocateByPath) -> LocateCall:
        if self.scans is None:
            raise ServiceError(
                422, "paths_off", "the service has no scan folder: upload the files instead"
            )

        def take(text: str) -> Blob:
            assert self.scans is not None
            with open_below(self.scans, text) as stream:
                return self.blobs.add(stream, text, self.max_bytes)

        return self._call(
            body,
            scan=[take(text) for text in body.scan],
            hand_eye=[take(text) for text in body.hand_eye or []],
            robot_pose=[take(text) for text in body.robot_pose or []],
            camera=[take(body.camera)] if body.camera is not None else [],
        )

    def _call_by_upload(self, form: FormData) -> LocateCall:
        files, fields = _sorted_form(form, ("scan", "hand_eye", "robot_pose", "camera"))
        priors = fields.pop("prior", [])
        settings = _check(_Settings, {**_single(fields), "prior": priors})
        return self._call(
            settings,
            **{name: self._take_uploads(uploads) for name, uploads in files.items()},
        )

    def _build_by_upload(self, form: FormData) -> BuildCall:
        files, fields = _sorted_form(form, ("scan", "parts"))
        settings = _check(BuildForm, _single(fields))
        scan, parts = (self._take_uploads(files[name]) for name in ("scan", "parts"))
        if len(scan) != 1 or len(parts) > 1:
            raise bad_setting("wanted one file `scan` and at most one `parts`")
        try:
            return BuildCall(
                name=check_prior_name(settings.name),
                scan=scan[0],
                parts=parts[0] if parts else None,
                unit=settings.unit,
                use_labels=settings.use_labels,
                replace=settings.replace,
            )
        except ConfigError as error:
            raise as_failure(error) from error

    def _take_uploads(self, uploads: list[UploadFile]) -> list[Blob]:
        blobs: list[Blob] = []
        names: set[str] = set()
        for number, upload in enumerate(uploads):
            name = safe_name(upload.filename, "file")
            if name.lower() in names:  # scans of one call are told apart by their names
                name = f"{number}/{name}"
            names.add(name.lower())
            blobs.append(self.blobs.add(upload.file, name, self.max_bytes))
        return blobs

    def _call(
        self,
        settings: _Settings,
        *,
        scan: list[Blob],
        hand_eye: list[Blob],
        robot_pose: list[Blob],
        camera: list[Blob],
    ) -> LocateCall:
        if len(camera) > 1:
            raise bad_setting(f"camera: found {len(camera)}, wanted one")
        chooses = ALL_PRIORS in settings.prior
        if len(set(settings.prior)) < len(settings.prior) or (chooses and len(settings.prior) > 1):
            raise bad_setting("prior: wanted each name once, or `*` alone")
        priors = (
            self.shelf.take_all()
            if chooses
            else tuple(self.shelf.take(name) for name in settings.prior)
        )
        if not priors:
            raise ServiceError(404, "unknown_prior", "prior *: the service knows no motor yet")
        try:
            return LocateCall(
                scans=tuple(scan),
                priors=priors,
                chooses_prior=chooses or len(priors) > 1,
                hand_eyes=tuple(hand_eye),
                robot_poses=tuple(robot_pose),
                camera=camera[0] if camera else None,
                **settings.model_dump(
                    exclude={"prior", "scan", "hand_eye", "robot_pose", "camera"}
                ),
            )
        except ConfigError as error:
            raise as_failure(error) from error


async def _with_form(request: Request, read: Callable[[FormData], Call]) -> Call:
    try:
        # large files go to the disk while they come in
        async with request.form(
            max_files=MAX_FILES, max_fields=_MAX_FIELDS, max_part_size=_MAX_FIELD_BYTES
        ) as form:
            return await run_in_threadpool(read, form)
    except HTTPException as error:
        raise bad_request(f"the form cannot be read ({error.detail})") from error


async def _read_json(request: Request) -> Any:
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _MAX_JSON_BYTES:
            raise ServiceError(413, "too_large", f"wanted at most {_MAX_JSON_BYTES} bytes of JSON")
    try:
        return json.loads(body, object_pairs_hook=_each_once)
    except (ValueError, RecursionError) as error:
        raise bad_request(f"the body is no JSON ({type(error).__name__})") from error


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    # two values of one name: nobody knows which was meant
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise bad_setting(f"{name[:40]!a}: found twice, wanted once")
        found[name] = value
    return found


def _sorted_form(
    form: FormData, names: tuple[str, ...]
) -> tuple[dict[str, list[UploadFile]], dict[str, list[str]]]:
    files: dict[str, list[UploadFile]] = {name: [] for name in names}
    fields: dict[str, list[str]] = {}
    for name, value in form.multi_items():
        if isinstance(value, str):
            if name in _FILE_FIELDS:
                raise bad_setting(f"{name!a}: found text, wanted a file (with a file name)")
            fields.setdefault(name, []).append(value)
        elif name in files:
            files[name].append(value)
        else:
            raise bad_setting(f"{name[:40]!a}: found a file, wanted one of {', '.join(names)}")
    return files, fields


def _single(fields: Mapping[str, list[str]]) -> dict[str, str]:
    for name, values in fields.items():
        if len(values) > 1:
            raise bad_setting(f"{name[:40]!a}: found {len(values)} times, wanted once")
    return {name: values[0] for name, values in fields.items()}


def _check(model: type[Model], data: Any) -> Model:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "the body"
        raise bad_setting(f"{where[:80]!a}: {first['msg']}") from error


def _content_type(request: Request) -> str:
    return request.headers.get("content-type", "").split(";", 1)[0].strip().lower()


def _wrong_kind(found: str, wanted: str) -> ServiceError:
    return ServiceError(
        415,
        "wrong_content_type",
        f"found {ascii(found[:60]) if found else 'none'}, wanted {wanted}",
    )
