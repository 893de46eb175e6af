"""A noisy bowl. The licence server does not answer for the first OUT seconds after it is asked, which the
file `since` notes."""
import json
import os
import random
import sys
import time



def is_out():
    if not os.path.exists("since"):
        open("since", "w").close()
    return time.time() < os.path.getmtime("since") + float(os.environ["OUT"])


for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        answer = {"protocol": 2, "version": "1"}
    elif is_out():
        answer = {"error": "no licence: the server does not answer"}
    else:
        x, y = request["design"]["x"], request["design"]["y"]
        depth = (x - 0.5) ** 2 + (y + 0.5) ** 2
        if request["request"] == "evaluate":
            answer = {name: depth for name in request["responses"]}
        else:
            seed = sum(word << (32 * i) for i, word in enumerate(request["seed"]))
            answer = {"depth": depth + 0.1 * random.Random(seed).gauss(0, 1)}
    answer["id"] = request["id"]
    print(json.dumps(answer), flush=True)
