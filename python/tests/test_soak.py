"""Campaigns whose processes are killed at any moment. ``PITCHLINE_SOAK_ROUNDS=100 pytest python/tests/test_soak.py`` is
the long run."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from simulators import BOWL, bowl, slow_campaign

import pitchline

ROUNDS = int(os.environ.get("PITCHLINE_SOAK_ROUNDS", "2"))


def family(pid):
    """A process and all that it started."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [pid, *(one for child in children for one in family(int(child)))]


def wait_for_the_end_of(pids):
    """What a killed process started ends in its own order."""
    deadline = time.monotonic() + 120.0
    while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the processes in /proc")
@pytest.mark.parametrize("round", range(ROUNDS))
def test_the_same_call_goes_on_after_kills(round, tmp_path, finished):
    chance = random.Random(4600 + round)
    db, out = tmp_path / "a.db", tmp_path / "report"
    program = slow_campaign(db, out, seconds=0.01)
    acts = []
    for _ in range(6):
        child = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
        time.sleep(chance.uniform(0.5, 3.0))
        # Itself, the coordinator, a worker or a function.
        everyone = family(child.pid)
        victim = everyone[0] if chance.random() < 0.3 or not everyone else chance.choice(everyone)
        how = chance.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGINT])
        acts.append(f"{how.name} {everyone.index(victim)} of {len(everyone)}")
        os.kill(victim, how)
        said = child.communicate(timeout=120.0)[1]
        wait_for_the_end_of(everyone)
        if child.returncode == 0:
            break
        acts.append(said.strip().splitlines()[-1] if said.strip() else str(child.returncode))
    done = pitchline.Campaign(BOWL, simulator=bowl).run(db, out=out, progress=False)
    assert done.status["samples_digest"] == finished.status["samples_digest"], acts
    assert done.recommended == {**finished.recommended, "cpu_seconds": done.recommended["cpu_seconds"]}, acts
