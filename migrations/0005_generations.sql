-- What the samples of a point, or the result of a run, were computed from: the digest of all inputs.
-- Results of another generation are not stored, so that what comes late for a design that has been
-- chosen anew is not taken for the new one's. Streams of which results were stored before this schema
-- have no row until a coordinator asks for more of them.

CREATE TABLE stream_generation (
    -- A point's name in `verify_sample`, or 'run ', an approach and a start.
    stream     TEXT    NOT NULL PRIMARY KEY,
    -- The 64 bits of the digest, read as two's complement.
    generation INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
