"""Evaluates the designs of a table with the gear model of a server: `client.py URL DESIGNS.csv`."""

import csv
import sys

import umbridge

url, table = sys.argv[1:]
model = umbridge.HTTPModel(url, "gear-pair")
variables, coefficients = model.get_input_sizes()
sampled, responses = model.get_output_sizes()
print("sizes", variables, sampled, responses)

# The values of the campaign's section [frozen].
FROZEN = [0.0003, 0.19, 0.64, 0.23, 30.0]
greatest = 0.0
with open(table) as file:
    rows = [row for row in csv.DictReader(file) if row["simulable"] == "1"]
assert rows, "no design can be simulated"
for row in rows:
    names = list(row)
    first = names.index("contact_ratio")
    stored = [float(row[name]) for name in names[first : first + responses]]
    free = [float(row[name]) for name in names[1:7]]
    worn, given = model([free + FROZEN, [0.0] * coefficients])
    greatest = max([greatest] + [abs(a - b) / abs(b) for a, b in zip(given, stored) if b != 0.0])
    # Without scatter the wear is Archard's.
    greatest = max(greatest, abs(worn[0] - stored[-1]) / stored[-1])
    scattered, _ = model([free + FROZEN, [1.0] + [0.0] * (coefficients - 1)])
    assert scattered != worn, "a coefficient without effect"
print("designs", len(rows), "greatest difference", greatest)

for wrong in ([[0.0] * variables, [0.0] * coefficients], [[1.0], []]):
    try:
        model(wrong)
    except Exception as error:
        print("refused", error)
