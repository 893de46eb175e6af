-- Where optimiser runs are that are not finished: a run of hours on a slow simulator goes on from here
-- when its worker is killed. A row is replaced by a later state of its run and removed with the run's
-- result. It is no result: a state that is lost or damaged costs time only.

CREATE TABLE run_state (
    -- 'run ', an approach and a start, as in `stream_generation`.
    stream      TEXT    NOT NULL PRIMARY KEY,
    -- The digest of the run's inputs: the 64 bits, read as two's complement.
    generation  INTEGER NOT NULL,
    -- The build of the program that wrote the state. Another build does not read it.
    build       TEXT    NOT NULL,
    -- Evaluations so far: of two states of a run, the one with more is the later one.
    evaluations INTEGER NOT NULL CHECK (evaluations >= 0),
    -- Processor time that led to the state.
    cpu_seconds REAL    NOT NULL,
    -- SHA-256 of the rest, and JSON.
    state       BLOB    NOT NULL CHECK (length(state) BETWEEN 1 AND 1048576)
) STRICT;
