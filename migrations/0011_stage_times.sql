-- How long each stage was the one that the campaign waited for, while a coordinator ran. Measured, so no part of
-- any result: at most the last minute before a coordinator was killed is missing.

CREATE TABLE stage_time (
    -- A stage's name in `coordinator status`.
    stage        TEXT NOT NULL PRIMARY KEY,
    wall_seconds REAL NOT NULL CHECK (wall_seconds >= 0)
) STRICT;
