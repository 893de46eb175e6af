-- Rounds of infill points: what each decided, written before its points are sampled. A row is never
-- changed, but for `failed`; rounds go when the responses that they rest on are cleared.

CREATE TABLE enrichment_round (
    round                   INTEGER NOT NULL PRIMARY KEY CHECK (round >= 0),
    -- The most that was expected of any observation; nothing where no model could tell.
    expected_improvement_um REAL,
    -- The best design so far, with the model's prediction; nothing without a model.
    recommendation_json     TEXT,
    -- Why the enrichment ends; nothing while it goes on.
    stop_json               TEXT,
    notes_json              TEXT    NOT NULL,
    -- Analyses that the search for points took.
    simulator_calls         INTEGER NOT NULL CHECK (simulator_calls >= 0),
    -- Measured, so no part of any result.
    cpu_seconds             REAL    NOT NULL
) STRICT;

CREATE TABLE infill (
    -- Counts over all rounds.
    infill    INTEGER NOT NULL PRIMARY KEY CHECK (infill >= 0),
    round     INTEGER NOT NULL REFERENCES enrichment_round (round),
    -- The point's name in `verify_sample`, and the number of its random streams.
    name      TEXT    NOT NULL UNIQUE,
    number    INTEGER NOT NULL UNIQUE CHECK (number >= 0),
    -- Why it was chosen.
    reason    TEXT    NOT NULL,
    x_p       REAL    NOT NULL,
    x_r       REAL    NOT NULL,
    ha0_p     REAL    NOT NULL,
    ha0_r     REAL    NOT NULL,
    hf0_p     REAL    NOT NULL,
    hf0_r     REAL    NOT NULL,
    -- How far the exact constraints are missed.
    violation REAL    NOT NULL,
    samples   INTEGER NOT NULL CHECK (samples > 0),
    -- Whether its samples were given up; set together with the round after.
    failed    INTEGER NOT NULL DEFAULT 0 CHECK (failed IN (0, 1))
) STRICT;
