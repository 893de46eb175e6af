-- The store of one campaign. Names carry their units; keys count from nought.
--
-- First write wins in `design`, `criteria`, `sample`, `verify_sample` and `optimiser_run`: their
-- rows are functions of the campaign file and of the program, so a second value is an error and
-- never an update. `response`, `model` and `optimum` are replaced when a stage is run again on
-- more data.

-- "PTCH": what tells a store from any other SQLite file.
PRAGMA application_id = 0x50544348;

CREATE TABLE campaign (
    one             INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
    name            TEXT    NOT NULL,
    file_text       TEXT    NOT NULL,
    -- Hex of the digest of the file's canonical content: what decides "the same campaign".
    digest          TEXT    NOT NULL,
    -- The 64 bits of an unsigned seed, read as two's complement: SQLite has no unsigned type.
    seed            INTEGER NOT NULL,
    program_version TEXT    NOT NULL,
    -- Pinned when the first worker registers.
    model_digest    TEXT
) STRICT;

CREATE TABLE design (
    design INTEGER NOT NULL PRIMARY KEY CHECK (design >= 0),
    x_p    REAL    NOT NULL,
    x_r    REAL    NOT NULL,
    ha0_p  REAL    NOT NULL,
    ha0_r  REAL    NOT NULL,
    hf0_p  REAL    NOT NULL,
    hf0_r  REAL    NOT NULL
) STRICT;

CREATE TABLE criteria (
    design                INTEGER NOT NULL PRIMARY KEY REFERENCES design (design),
    feasible              INTEGER NOT NULL CHECK (feasible IN (0, 1)),
    -- Why it is infeasible: a code and a sentence.
    reason                TEXT,
    contact_ratio         REAL,
    specific_sliding      REAL,
    hertz_pressure_mpa    REAL,
    hertz_pressure_worn_mpa REAL,
    root_stress_mpa       REAL,
    clearance_p_mm        REAL,
    clearance_r_mm        REAL,
    flank_margin_p_mm     REAL,
    flank_margin_r_mm     REAL,
    delta_ste_um          REAL,
    delta_ste_archard_um  REAL
) STRICT;

CREATE TABLE sample (
    design       INTEGER NOT NULL REFERENCES design (design),
    sample       INTEGER NOT NULL CHECK (sample >= 0),
    delta_ste_um REAL    NOT NULL,
    PRIMARY KEY (design, sample)
) STRICT, WITHOUT ROWID;

CREATE TABLE response (
    design           INTEGER NOT NULL PRIMARY KEY REFERENCES design (design),
    mean_um          REAL    NOT NULL,
    sd_um            REAL    NOT NULL,
    p90_um           REAL    NOT NULL,
    p90_variance_um2 REAL    NOT NULL,
    lilliefors_p     REAL
) STRICT;

CREATE TABLE model (
    name         TEXT NOT NULL PRIMARY KEY,
    json         TEXT NOT NULL,
    summary_json TEXT NOT NULL
) STRICT;

CREATE TABLE optimiser_run (
    approach        TEXT    NOT NULL,
    start           INTEGER NOT NULL CHECK (start >= 0),
    result_json     TEXT    NOT NULL,
    simulator_calls INTEGER NOT NULL CHECK (simulator_calls >= 0),
    cpu_seconds     REAL    NOT NULL,
    PRIMARY KEY (approach, start)
) STRICT;

CREATE TABLE optimum (
    approach        TEXT    NOT NULL PRIMARY KEY,
    -- An object of every variable's value by name.
    x_json          TEXT    NOT NULL,
    criterion_um    REAL    NOT NULL,
    feasible        INTEGER NOT NULL CHECK (feasible IN (0, 1)),
    criteria_json   TEXT    NOT NULL,
    simulator_calls INTEGER NOT NULL CHECK (simulator_calls >= 0),
    cpu_seconds     REAL    NOT NULL,
    note            TEXT    NOT NULL
) STRICT;

-- No foreign key to `optimum`: an optimum may be replaced while its old samples are still there
-- to be compared with.
CREATE TABLE verify_sample (
    approach     TEXT    NOT NULL,
    sample       INTEGER NOT NULL CHECK (sample >= 0),
    delta_ste_um REAL    NOT NULL,
    PRIMARY KEY (approach, sample)
) STRICT, WITHOUT ROWID;

-- What a finished job cost: measured, so no part of any result.
CREATE TABLE job_time (
    job         INTEGER NOT NULL PRIMARY KEY,
    cpu_seconds REAL    NOT NULL
) STRICT;

-- Append-only: what went wrong, in the order in which it was reported.
CREATE TABLE failure (
    failure    INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
    job        TEXT    NOT NULL,
    attempt    INTEGER NOT NULL CHECK (attempt >= 0),
    worker     TEXT    NOT NULL,
    kind       TEXT    NOT NULL CHECK (kind IN ('crash', 'failure', 'quarantine')),
    error      TEXT    NOT NULL,
    at_unix_ms INTEGER
) STRICT;
