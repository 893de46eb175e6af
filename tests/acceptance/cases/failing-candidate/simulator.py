"""A noisy bowl whose solver diverges, and ends the program, where a is above 0.9."""
import json
import os
import random
import sys

for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        answer = {"protocol": 2, "version": "1"}
    else:
        a, b = request["design"]["a"], request["design"]["b"]
        if a > 0.9:
            sys.stderr.write("solver diverged\n")
            os._exit(3)
        y = (a - 0.3) ** 2 + (b - 0.3) ** 2
        if request["request"] == "evaluate":
            answer = {name: y for name in request["responses"]}
        else:
            seed = sum(word << (32 * i) for i, word in enumerate(request["seed"]))
            answer = {"y": y + 0.05 * random.Random(seed).gauss(0, 1)}
    answer["id"] = request["id"]
    print(json.dumps(answer), flush=True)
