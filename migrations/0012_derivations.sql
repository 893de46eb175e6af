-- What each derived result was computed from. A result whose inputs have changed, for example because a
-- quarantined job has delivered after all, is computed again. Results of earlier schemas have no row and are
-- computed again, too.

CREATE TABLE derivation (
    -- 'samples', 'responses', 'model', 'round ' and its number, 'optimum ' and an approach, 'run ', an approach
    -- and a start.
    name    TEXT    NOT NULL PRIMARY KEY,
    -- The digest of everything that the result depends on, in hex.
    inputs  TEXT    NOT NULL,
    -- The digest of the result, in hex; NULL where no other result is computed from it.
    output  TEXT,
    -- Why there is no result: of a fit that failed.
    failure TEXT,
    -- As in the other tables: the first 64 bits of a SHA-256 of the row's columns.
    seal    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- The row of the responses has the digest of the samples.
ALTER TABLE tally DROP COLUMN samples_of_responses;
