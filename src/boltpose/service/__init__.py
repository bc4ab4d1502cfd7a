"""`boltpose serve`: the main job over HTTP, with a journal that an auditor can replay."""

from boltpose.service.config import ServiceConfig

__all__ = ["ServiceConfig"]
