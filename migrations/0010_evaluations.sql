-- What an external simulator says of the candidates of an optimiser run. The coordinator holds the
-- search: killed, it computes the search again from these rows, so the states of unfinished runs are
-- gone. Runs on the built-in simulator take seconds and have no rows here.

DROP TABLE run_state;

CREATE TABLE evaluation (
    -- 'run ', an approach and a start, as in `stream_generation`.
    stream        TEXT    NOT NULL,
    -- Which evaluation of the run, from 0.
    evaluation    INTEGER NOT NULL CHECK (evaluation >= 0),
    -- As in the other tables: the first 64 bits of a SHA-256 of the row's columns.
    seal          INTEGER NOT NULL,
    -- The values of all variables; lists are 64-bit IEEE 754 numbers, little-endian.
    x             BLOB    NOT NULL CHECK (length(x) > 0 AND length(x) % 8 = 0),
    -- Why the design cannot be simulated; the columns below are NULL then.
    refused       TEXT,
    -- The response without random effects; NULL also of a problem without a baseline.
    value         REAL,
    -- What constraints are set on, in the order of the problem.
    criteria      BLOB    CHECK (length(criteria) % 8 = 0),
    -- The same in the baseline state, where a gear pair that was searched without wear was asked for it.
    worn_criteria BLOB    CHECK (length(worn_criteria) % 8 = 0),
    -- Of a direct search, the sampled response; NULL where a constraint is broken.
    samples       BLOB    CHECK (length(samples) % 8 = 0),
    PRIMARY KEY (stream, evaluation)
) STRICT, WITHOUT ROWID;
