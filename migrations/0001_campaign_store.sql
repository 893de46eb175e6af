-- The store of one campaign. Names carry units where a column always has the same; indices count from 0.
--
-- The first write wins in `design`, `criteria`, `sample_block`, `optimiser_run` and `evaluation`: their rows are
-- functions of the campaign file and of the program, so a second value is an error and never an update. What is
-- derived from them is removed and computed again when its inputs change (table `derivation`).
--
-- Lists of numbers are 64-bit IEEE 754 numbers, little-endian, in the order of the problem's variables or
-- responses, which `coordinator export` names. In Python: numpy.frombuffer(x, '<f8').
--
-- `stream` identifies a design, point or run that workers compute, as one number: a design's index; 1 << 56 | a point's
-- number (an optimum has its approach's number); for a run 2 << 56 | the approach's number << 32 | the start.
--
-- `seal` is a digest of the row's other columns, the first 64 bits of a SHA-256 read as two's complement: a value
-- that changes outside the program is noticed when the row is read. Rows that neither are results nor decide what is
-- computed, such as times, have none. Indexes are compared with their tables when the store is opened or checked.

-- "PTCH": distinguishes a store from other SQLite files.
PRAGMA application_id = 0x50544348;

CREATE TABLE campaign (
    one             INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
    name            TEXT    NOT NULL,
    file_text       TEXT    NOT NULL,
    -- Hex of the digest of the file's canonical content. Files with the same digest are the same campaign.
    digest          TEXT    NOT NULL,
    -- The 64 bits of an unsigned seed, read as two's complement: SQLite has no unsigned type.
    seed            INTEGER NOT NULL,
    program_version TEXT    NOT NULL,
    -- Pinned when the first worker registers.
    model_digest    TEXT,
    seal            INTEGER NOT NULL
) STRICT;

-- The worker processes that computed the rows with their number in the column `origin`; NULL there stands for the
-- coordinator itself, or for a source that is not known. No result depends on an origin.
CREATE TABLE origin (
    origin INTEGER NOT NULL PRIMARY KEY,
    worker TEXT    NOT NULL,
    -- As the worker named it, or the file that its results were merged from.
    host   TEXT    NOT NULL,
    build  TEXT    NOT NULL,
    seal   INTEGER NOT NULL,
    UNIQUE (worker, host, build)
) STRICT;

CREATE TABLE design (
    design INTEGER NOT NULL PRIMARY KEY CHECK (design >= 0),
    x      BLOB    NOT NULL CHECK (length(x) > 0 AND length(x) % 8 = 0),
    seal   INTEGER NOT NULL
) STRICT;

CREATE TABLE criteria (
    design    INTEGER NOT NULL PRIMARY KEY REFERENCES design (design),
    -- Whether the simulator gives numbers for the design.
    simulable INTEGER NOT NULL CHECK (simulable IN (0, 1)),
    -- Why it is not simulable, or why it gets no samples although it is: a code and a sentence.
    reason    TEXT,
    -- NULL for a design that is not simulable.
    responses BLOB    CHECK (length(responses) % 8 = 0),
    seal      INTEGER NOT NULL,
    -- Not part of the digest, here and in the tables of runs and evaluations: results with other origins are the same.
    origin    INTEGER REFERENCES origin (origin)
) STRICT;

-- The samples of designs, of optima that are verified and of infill points, packed: a row for each sample would cost
-- ten times as much processor time.
CREATE TABLE sample_block (
    stream       INTEGER NOT NULL,
    -- The block is first_sample .. first_sample + length(samples) / (8 * responses). Blocks of one stream never overlap;
    -- they may touch, and the samples between them are missing.
    first_sample INTEGER NOT NULL CHECK (first_sample >= 0),
    -- Number of sampled responses: the values of one sample.
    responses    INTEGER NOT NULL CHECK (responses > 0),
    -- Sample after sample, at most 4096 values. An infinite one stands for a sample that failed.
    samples      BLOB    NOT NULL
                 CHECK (length(samples) BETWEEN 8 AND 32768 AND length(samples) % (8 * responses) = 0),
    seal         INTEGER NOT NULL,
    -- Part of the digest. Samples of two origins are never in one block.
    origin       INTEGER REFERENCES origin (origin),
    PRIMARY KEY (stream, first_sample)
) STRICT, WITHOUT ROWID;

-- The measures of each design's samples: what the campaign optimises, such as their percentile at a level, and what its
-- constraints limit.
CREATE TABLE response (
    design              INTEGER NOT NULL REFERENCES design (design),
    -- 0 is the measure that is optimised; the others are those of constraints, in the order of the campaign file.
    number              INTEGER NOT NULL CHECK (number >= 0),
    mean                REAL    NOT NULL,
    standard_deviation  REAL    NOT NULL,
    measure             REAL    NOT NULL,
    measure_variance    REAL    NOT NULL,
    lilliefors_p        REAL,
    seal                INTEGER NOT NULL,
    PRIMARY KEY (design, number)
) STRICT, WITHOUT ROWID;

CREATE TABLE model (
    name         TEXT    NOT NULL,
    -- The measure that it is a model of, as in table `response`; after these, the deterministic responses that are modelled.
    number       INTEGER NOT NULL CHECK (number >= 0),
    json         TEXT    NOT NULL,
    summary_json TEXT    NOT NULL,
    seal         INTEGER NOT NULL,
    PRIMARY KEY (name, number)
) STRICT, WITHOUT ROWID;

CREATE TABLE optimiser_run (
    stream          INTEGER NOT NULL PRIMARY KEY,
    result_json     TEXT    NOT NULL,
    simulator_calls INTEGER NOT NULL CHECK (simulator_calls >= 0),
    -- Measured, here and below, so no part of any result.
    cpu_seconds     REAL    NOT NULL,
    seal            INTEGER NOT NULL,
    origin          INTEGER REFERENCES origin (origin)
) STRICT;

-- Evaluations of the candidates of an optimiser run by an external simulator. A restarted coordinator computes the
-- search again from these rows. Runs on the built-in simulator take seconds and have no rows here.
CREATE TABLE evaluation (
    -- A run or an infill point.
    stream        INTEGER NOT NULL,
    -- Index of the evaluation within the run, from 0.
    evaluation    INTEGER NOT NULL CHECK (evaluation >= 0),
    seal          INTEGER NOT NULL,
    x             BLOB    NOT NULL CHECK (length(x) > 0 AND length(x) % 8 = 0),
    -- Why the design cannot be simulated; the columns below are NULL then.
    refused       TEXT,
    -- The response without random effects; NULL also of a problem without a baseline.
    value         REAL,
    -- What constraints are set on.
    criteria      BLOB    CHECK (length(criteria) % 8 = 0),
    -- The same in the baseline state; NULL unless a gear pair is searched without wear.
    worn_criteria BLOB    CHECK (length(worn_criteria) % 8 = 0),
    -- The samples, as in sample_block, for a direct search; NULL if a constraint is violated.
    samples       BLOB    CHECK (length(samples) % 8 = 0),
    origin        INTEGER REFERENCES origin (origin),
    PRIMARY KEY (stream, evaluation)
) STRICT, WITHOUT ROWID;

CREATE TABLE optimum (
    -- The point that the optimum is verified at: its number is its approach's.
    stream          INTEGER NOT NULL PRIMARY KEY,
    -- Why the approach found no design; x, criterion and criteria are NULL then.
    reason          TEXT,
    -- The values of all variables.
    x               BLOB    CHECK (length(x) > 0 AND length(x) % 8 = 0),
    -- What the approach minimised.
    criterion       REAL,
    -- What constraints are set on.
    criteria        BLOB    CHECK (length(criteria) % 8 = 0),
    feasible        INTEGER NOT NULL CHECK (feasible IN (0, 1)),
    simulator_calls INTEGER NOT NULL CHECK (simulator_calls >= 0),
    cpu_seconds     REAL    NOT NULL,
    note            TEXT    NOT NULL,
    seal            INTEGER NOT NULL
) STRICT;

-- The decisions of rounds of infill, written before their points are sampled.
CREATE TABLE enrichment_round (
    round                INTEGER NOT NULL PRIMARY KEY CHECK (round >= 0),
    -- The largest expected improvement of any observation; NULL without a model.
    expected_improvement REAL,
    -- The best design so far, with the model's prediction; NULL without a model.
    recommendation_json  TEXT,
    -- Why the enrichment ends; NULL while it continues.
    stop_json            TEXT,
    notes_json           TEXT    NOT NULL,
    -- Number of analyses in the search for points.
    simulator_calls      INTEGER NOT NULL CHECK (simulator_calls >= 0),
    cpu_seconds          REAL    NOT NULL,
    seal                 INTEGER NOT NULL
) STRICT;

CREATE TABLE infill (
    -- Counts over all rounds.
    infill    INTEGER NOT NULL PRIMARY KEY CHECK (infill >= 0),
    round     INTEGER NOT NULL REFERENCES enrichment_round (round),
    name      TEXT    NOT NULL UNIQUE,
    -- Its index as a stream and as the source of its random numbers.
    number    INTEGER NOT NULL UNIQUE CHECK (number >= 0),
    -- Why it was chosen.
    reason    TEXT    NOT NULL,
    x         BLOB    NOT NULL CHECK (length(x) > 0 AND length(x) % 8 = 0),
    -- Constraint violation with the exact constraints.
    violation REAL    NOT NULL,
    samples   INTEGER NOT NULL CHECK (samples > 0),
    -- Whether it got no samples; set together with the round after.
    failed    INTEGER NOT NULL CHECK (failed IN (0, 1)),
    seal      INTEGER NOT NULL
) STRICT;

-- The digest of all inputs of the samples of a point or of the result of a run. Results of another generation are not
-- stored: they may arrive late, for a design that was replaced since.
CREATE TABLE stream_generation (
    stream     INTEGER NOT NULL PRIMARY KEY,
    -- The 64 bits of the digest, read as two's complement.
    generation INTEGER NOT NULL
) STRICT;

-- The inputs of each derived result. A result whose inputs have changed, for example because a quarantined job has
-- delivered after all, is computed again.
CREATE TABLE derivation (
    -- 'samples', 'responses', 'model', 'round ' and its number, 'optimum ' and an approach, or the stream of a run.
    name    TEXT    NOT NULL PRIMARY KEY,
    -- The digest of everything that the result depends on, in hex.
    inputs  TEXT    NOT NULL,
    -- The digest of the result, in hex; NULL where no other result is computed from it.
    output  TEXT,
    -- Why there is no result, for a fit that failed.
    failure TEXT,
    seal    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Tallies of the tables that grow large, so that counting does not read them. They are written in the transactions that
-- write the rows they count.

-- A stream without a row here has no samples. It has those of 0..samples, without a hole, exactly when
-- samples = last_sample + 1.
CREATE TABLE sample_tally (
    stream      INTEGER NOT NULL PRIMARY KEY,
    samples     INTEGER NOT NULL CHECK (samples > 0 AND samples <= last_sample + 1),
    last_sample INTEGER NOT NULL,
    -- The number of failed samples.
    failed      INTEGER NOT NULL CHECK (failed BETWEEN 0 AND samples),
    -- The sum modulo 2^256 of the SHA-256 of every sample, both read as little-endian numbers.
    digest      BLOB    NOT NULL CHECK (length(digest) = 32),
    seal        INTEGER NOT NULL
) STRICT;

CREATE TABLE commit_tally (
    one     INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
    -- The lock file says how many were acknowledged: fewer here mean that the log was cut, or that this is an older copy.
    commits INTEGER NOT NULL CHECK (commits >= 0)
) STRICT;

INSERT INTO commit_tally (one, commits) VALUES (1, 0);

-- The cost of a finished job.
CREATE TABLE job_time (
    stream      INTEGER NOT NULL,
    -- The key of the job within its stream: the first sample, or a number that differs for each generation.
    part        INTEGER NOT NULL CHECK (part >= 0),
    cpu_seconds REAL    NOT NULL,
    PRIMARY KEY (stream, part)
) STRICT, WITHOUT ROWID;

-- The stage that the campaign waits for, as the last coordinator saw it.
CREATE TABLE stage (
    one   INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
    -- Its name in `coordinator status`; 'done' once nothing is left.
    stage TEXT    NOT NULL
) STRICT;

-- Time that the campaign waited for each stage while a coordinator ran. At most the last minute before a coordinator was
-- killed is missing.
CREATE TABLE stage_time (
    -- A stage's name in `coordinator status`.
    stage        TEXT NOT NULL PRIMARY KEY,
    wall_seconds REAL NOT NULL CHECK (wall_seconds >= 0)
) STRICT;

-- Crashes, failures and quarantines in the order of their reports. Append-only.
CREATE TABLE failure (
    failure    INTEGER NOT NULL PRIMARY KEY,
    stream     INTEGER NOT NULL,
    -- The first sample that failed or was held; NULL for a failure of the stream as a whole.
    sample     INTEGER CHECK (sample >= 0),
    -- Whether the worker that died held other streams, too, any of which may be the cause.
    shared     INTEGER NOT NULL CHECK (shared IN (0, 1)),
    -- The number of the lease under which it happened.
    lease      INTEGER NOT NULL CHECK (lease >= 0),
    worker     TEXT    NOT NULL,
    -- The worker's own number of the report, by which a repeated report is recognised, also by a restarted coordinator.
    -- Crashes are recorded by the coordinator and have none.
    serial     INTEGER,
    kind       TEXT    NOT NULL CHECK (kind IN ('crash', 'failure', 'quarantine')),
    error      TEXT    NOT NULL,
    at_unix_ms INTEGER,
    seal       INTEGER NOT NULL
) STRICT;

CREATE UNIQUE INDEX failure_once ON failure (worker, serial) WHERE serial IS NOT NULL;

-- Failures by cause: the first line of the error without its numbers.
CREATE TABLE failure_tally (
    kind         TEXT    NOT NULL,
    cause        TEXT    NOT NULL,
    failures     INTEGER NOT NULL CHECK (failures > 0),
    last_failure INTEGER NOT NULL REFERENCES failure (failure),
    seal         INTEGER NOT NULL,
    PRIMARY KEY (kind, cause)
) STRICT, WITHOUT ROWID;
