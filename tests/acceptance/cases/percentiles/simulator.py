"""y is a bowl of a and b plus a random number of the distribution that the argument names."""
import json, random, sys


def draw(law, rng):
    if law == "exponential":
        return rng.expovariate(1.0)
    if law == "lognormal":
        return rng.lognormvariate(0.0, 1.0)
    if law == "bimodal":
        return rng.gauss(0.0, 0.1) + (1.0 if rng.random() < 0.2 else 0.0)
    if law == "rare-jump":
        return rng.gauss(0.0, 1.0) + (20.0 if rng.random() < 0.06 else 0.0)
    raise SystemExit(f"no distribution {law}")


for line in sys.stdin:
    request = json.loads(line)
    answer = {"id": request["id"]}
    if request["request"] == "describe":
        answer |= {"protocol": 2, "version": "1"}
    else:
        y = 5.0 + sum((value - 0.3) ** 2 for value in request["design"].values())
        if request["request"] == "sample":
            seed = sum(word << (32 * place) for place, word in enumerate(request["seed"]))
            y += draw(sys.argv[1], random.Random(seed))
        answer["y"] = y
    print(json.dumps(answer), flush=True)
