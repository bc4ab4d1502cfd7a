"""What `boltpose config check` looks at: every section, with the packages that will use it."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

from boltpose.cell import CellFile, LocateSection
from boltpose.cell.check import Finding, Level, check_locate, describe_models
from boltpose.cell.slips import tell_file_error
from boltpose.cli.outputs import check_folder
from boltpose.errors import BoltposeError, InputFileError, UnitError
from boltpose.io.hand_eye import read_hand_eye
from boltpose.robot import RobotConfig
from boltpose.service.config import ServiceConfig
from boltpose.service.database import open_database
from boltpose.service.keys import KeyRing
from boltpose.viewer.config import ViewerConfig


def check_cell(cell: CellFile, kinds: Mapping[str, type]) -> Iterator[Finding]:
    """Test all that can be tested before production.

    Args:
        cell: The settings file.
        kinds: The dataclass of each section, by name.
    """
    located: LocateSection | None = None
    for section, kind in kinds.items():
        try:
            settings = cell.settings(section, kind)
        except BoltposeError as error:
            yield Finding(section=section, key="", level=Level.FAIL, text=str(error))
            continue
        if isinstance(settings, LocateSection):
            located = settings
            yield from check_locate(settings)
            continue
        if not cell.tables.get(section):
            continue
        yield Finding(section=section, key="", level=Level.OK, text="keys and ranges")
        if isinstance(settings, RobotConfig):
            yield from _check_robot(settings, located)
        elif isinstance(settings, ServiceConfig):
            yield from _check_service(settings)
        elif isinstance(settings, ViewerConfig):
            yield from _check_port("viewer", "127.0.0.1", settings.port)


def _check_robot(config: RobotConfig, located: LocateSection | None) -> Iterator[Finding]:
    def say(key: str, level: Level, text: str) -> Finding:
        return Finding(section="robot", key=key, level=level, text=text)

    if config.min_tool_fits is not None and located and located.tool_tolerance is None:
        text = "needs tool_tolerance under [locate], or export-poses ends with an error"
        yield say("min_tool_fits", Level.WARN, text)
    if config.tcp is None:
        return
    try:
        found = read_hand_eye(config.tcp, target="flange", source="tool")
    except UnitError as error:  # its hint names an option that is not about this file
        found_mm = error.found.split(" (")[0]
        yield say("tcp", Level.FAIL, f"{error.path}: found {found_mm}, wanted a matrix in mm")
    except InputFileError as error:
        yield say("tcp", Level.FAIL, tell_file_error(error))
    else:
        x, y, z = found.transform.translation_mm
        yield say("tcp", Level.OK, f"the tool's tip at {x:.1f} {y:.1f} {z:.1f} mm of the flange")


def _check_service(config: ServiceConfig) -> Iterator[Finding]:
    def say(key: str, level: Level, text: str) -> Finding:
        return Finding(section="service", key=key, level=level, text=text)

    data, priors = Path(config.data), Path(config.priors)
    try:
        check_folder(data, "journal, inputs and keys")
    except InputFileError as error:
        yield say("data", Level.FAIL, str(error))
    if priors.exists() and not priors.is_dir():
        yield say("priors", Level.FAIL, f"{priors}: found a file, wanted a folder of priors")
    elif not priors.exists():  # the service makes it
        yield say("priors", Level.WARN, f"{priors}: found no such folder, wanted one with priors")
    elif config.can_change_priors and not os.access(priors, os.W_OK):
        yield say("priors", Level.WARN, f"{priors}: clients cannot build priors, not writable")
    if config.scans is not None and not Path(config.scans).is_dir():
        yield say("scans", Level.FAIL, f"{config.scans}: found no such folder, wanted one")
    if config.models is not None:
        try:
            for level, text in describe_models(Path(config.models)):
                yield say("models", level, text)
        except InputFileError as error:
            yield say("models", Level.FAIL, tell_file_error(error))
    if config.database is not None:
        try:
            open_database(data, config.database).dispose()
            yield say("database", Level.OK, "answers")
        except BoltposeError as error:
            yield say("database", Level.FAIL, str(error))
    yield from _check_port("service", config.host, config.port)
    if not config.is_loopback:
        try:
            count = len(KeyRing(data).keys) if data.is_dir() else 0
        except BoltposeError as error:
            yield say("data", Level.FAIL, str(error))
            return
        level = Level.OK if count else Level.FAIL
        text = f"{config.host} is no loopback address: found {count} API keys, wanted one or more"
        yield say("host", level, text + ("" if count else " (`boltpose serve --new-key NAME`)"))


def _check_port(section: str, host: str, port: int) -> Iterator[Finding]:
    """Try to take the port; one in use may well be the service itself."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        # as servers do: a port that was used a moment ago is free
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            is_used = error.errno == errno.EADDRINUSE
            hint = {
                errno.EADDRINUSE: f"; is the {section} running?",
                errno.EACCES: "; take one above 1023",
            }.get(error.errno or 0, "; wanted an address of this computer")
            yield Finding(
                section=section,
                key="port" if is_used or error.errno == errno.EACCES else "host",
                level=Level.WARN if is_used else Level.FAIL,
                text=f"{host} port {port}: {reason}{hint}",
            )
