"""Builds the wheel: the module by maturin, and with it the programs `coordinator` and `worker`."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import get_requires_for_build_wheel, prepare_metadata_for_build_wheel

__all__ = ["build_sdist", "build_wheel", "get_requires_for_build_wheel", "prepare_metadata_for_build_wheel"]

HERE = Path(__file__).resolve().parent
PROGRAMS = ("coordinator", "worker")


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    packages = [argument for program in PROGRAMS for argument in ("--package", program)]
    subprocess.run(["cargo", "build", "--release", "--locked", *packages], cwd=HERE, check=True)
    built = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent / "target")) / "release"
    scripts = HERE / "pitchline.data" / "scripts"
    scripts.mkdir(parents=True, exist_ok=True)
    for program in PROGRAMS:
        shutil.copy2(built / program, scripts / program)
    try:
        return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)
    finally:
        shutil.rmtree(scripts.parent)


def build_sdist(sdist_directory, config_settings=None):
    raise RuntimeError(
        "there is no source distribution of the package alone: it is built from a checkout of the whole repository, "
        "with `pip install ./python`"
    )
