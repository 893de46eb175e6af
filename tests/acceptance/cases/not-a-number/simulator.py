"""A noisy bowl whose half with a above 0.5 has no number: argument 1 says what it answers there, and
argument 2, if given, in which share of the samples elsewhere. With "repaired" all of it has numbers."""
import json
import random
import sys

odd = {"nan": float("nan"), "inf": float("inf"), "null": None}.get(sys.argv[1])
share = float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        answer = {"protocol": 2, "version": "1"}
    else:
        a, b = request["design"]["a"], request["design"]["b"]
        has_none = a > 0.5 and sys.argv[1] != "repaired"
        y = (a - 0.3) ** 2 + (b - 0.3) ** 2
        if request["request"] == "evaluate":
            answer = {name: odd if has_none else y for name in request["responses"]}
        else:
            seed = sum(word << (32 * i) for i, word in enumerate(request["seed"]))
            generator = random.Random(seed)
            has_none = has_none or generator.random() < share
            answer = {"y": odd if has_none else y + 0.1 * generator.gauss(0, 1)}
        if has_none and sys.argv[1] == "refused":
            answer = {"refused": "no-convergence: the iteration did not end"}
        if has_none and sys.argv[1] == "error":
            answer = {"error": "the iteration did not end"}
    answer["id"] = request["id"]
    print(json.dumps(answer), flush=True)
