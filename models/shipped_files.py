"""The scenes that are shipped, as files, and the names in them."""

from pathlib import Path

BODY, TABLE = "block", "table"


def scene_path(name: str) -> Path:
    """The MJCF file of a scene of this package."""
    return Path(__file__).parent / f"{name}.xml"
