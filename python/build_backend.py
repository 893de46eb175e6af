"""Builds the wheel: the module by maturin, and with it the programs, their man pages and completions."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import get_requires_for_build_wheel

__all__ = ["build_sdist", "build_wheel", "get_requires_for_build_wheel"]

HERE = Path(__file__).resolve().parent
PROGRAMS = ("coordinator", "worker")


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    # All three at once: building each alone would enable other features of some crates and build them again.
    packages = [f"--package={name}" for name in (*PROGRAMS, "pitchline-python")]
    further = shlex.split((config_settings or {}).get("build-args", ""))
    # maturin takes the same arguments, and without a profile it builds a release, too.
    is_development = "--profile=dev" in further
    if not is_development:
        further.append("--release")
    subprocess.run(["cargo", "build", "--locked", *packages, *further], cwd=HERE, check=True)
    folder = "debug" if is_development else "release"
    built = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent / "target")) / folder
    data = HERE / "pitchline.data"
    shutil.copytree(HERE.parent / "share", data / "data" / "share", dirs_exist_ok=True)
    (data / "scripts").mkdir(exist_ok=True)
    for program in PROGRAMS:
        shutil.copy2(built / program, data / "scripts" / program)
    try:
        return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)
    finally:
        shutil.rmtree(data)


def build_sdist(sdist_directory, config_settings=None):
    raise RuntimeError(
        "there is no source distribution of the package alone: it is built from a checkout of the whole repository, "
        "with `pip install ./python`"
    )
