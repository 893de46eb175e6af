"""Passes the lines of another program on, but fails for some designs while there is an outage.

The file `outage` in the working folder says for which share, in percent: for 100 every request fails, for less
only samples of the designs that a seed chooses.

    outage.py SEED COMMAND...
"""

import hashlib
import json
import subprocess
import sys


def share():
    try:
        with open("outage", encoding="ascii") as file:
            return int(file.read() or 0)
    except OSError:
        return 0


def fails(request):
    wanted = share()
    if request["request"] == "describe" or wanted == 0:
        return False
    if wanted == 100:
        return True
    parts = json.dumps([sys.argv[1], request["design"]], sort_keys=True)
    draw = hashlib.sha256(parts.encode()).digest()[0] * 100 // 256
    return request["request"] == "sample" and draw < wanted


program = subprocess.Popen(
    sys.argv[2:], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
)
for line in sys.stdin:
    request = json.loads(line)
    if fails(request):
        answer = json.dumps({"error": "no licence: an outage", "id": request["id"]}) + "\n"
    else:
        program.stdin.write(line)
        program.stdin.flush()
        answer = program.stdout.readline()
        while answer and not answer.startswith("{"):
            # Not an answer: another line follows it.
            print(answer, end="", flush=True)
            answer = program.stdout.readline()
    if not answer:
        sys.exit(program.wait())
    print(answer, end="", flush=True)
program.stdin.close()
sys.exit(program.wait())
