-- Tallies of the two tables that grow large, so that nobody has to read them in order to count
-- them. They are written in the transactions that write the rows they count.

CREATE TABLE tally (
    one            INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
    samples        INTEGER NOT NULL CHECK (samples >= 0),
    -- The sum modulo 2^256 of the SHA-256 of every sample, both read as little-endian numbers. SQL
    -- has no SHA-256: the program that runs this migration adds the samples up, in the same
    -- transaction.
    samples_digest BLOB    NOT NULL CHECK (length(samples_digest) = 32),
    -- The lock file says how many were acknowledged: fewer here mean that the log was cut.
    commits        INTEGER NOT NULL CHECK (commits >= 0)
) STRICT;

INSERT INTO tally (one, samples, samples_digest, commits)
SELECT 1, count(*), zeroblob(32), 0 FROM sample;

-- A design without a row here has no samples. It has those of 0..samples, without a hole, exactly
-- when samples = last_sample + 1.
CREATE TABLE design_tally (
    design      INTEGER NOT NULL PRIMARY KEY REFERENCES design (design),
    samples     INTEGER NOT NULL CHECK (samples > 0 AND samples <= last_sample + 1),
    last_sample INTEGER NOT NULL
) STRICT;

INSERT INTO design_tally (design, samples, last_sample)
SELECT design, count(*), max(sample) FROM sample GROUP BY design;

CREATE TABLE verify_tally (
    approach TEXT    NOT NULL PRIMARY KEY,
    samples  INTEGER NOT NULL CHECK (samples > 0)
) STRICT, WITHOUT ROWID;

INSERT INTO verify_tally (approach, samples)
SELECT approach, count(*) FROM verify_sample GROUP BY approach;

-- Counts of criteria, and of the feasible ones, from a tenth of the pages.
CREATE INDEX criteria_feasible ON criteria (feasible);

-- Failures by cause: the first line of the error without its numbers, which the program fills in
-- for failures that are there already, in the same transaction.
CREATE TABLE failure_tally (
    kind         TEXT    NOT NULL,
    cause        TEXT    NOT NULL,
    failures     INTEGER NOT NULL CHECK (failures > 0),
    last_failure INTEGER NOT NULL REFERENCES failure (failure),
    PRIMARY KEY (kind, cause)
) STRICT, WITHOUT ROWID;
