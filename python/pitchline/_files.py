"""The programs of the package, and texts for them."""

from __future__ import annotations

import json
import os
import shutil
import sysconfig
from typing import Any

from pitchline import _pitchline

__all__ = ["program", "toml_of"]


def toml_of(sections: dict[str, Any]) -> str:
    """The sections as TOML; numbers of numpy become plain ones."""
    return _pitchline.toml_of(json.dumps(_plain(sections)))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items() if one is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    # Arrays and numbers of numpy.
    return value.tolist() if hasattr(value, "tolist") else value


def program(name: str) -> str:
    """The path of ``coordinator`` or ``worker``: the one that came with this package, else the first on the PATH."""
    scripts = sysconfig.get_path("scripts")
    found = shutil.which(name, path=scripts) or shutil.which(name)
    if found is None:
        raise FileNotFoundError(
            f"the program {name} is neither in {scripts} nor on the PATH: it is part of the wheel of pitchline, "
            f"install that again"
        )
    return os.fspath(found)
