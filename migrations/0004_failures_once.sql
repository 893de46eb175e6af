-- A worker that was not told that its report of a failure is stored hands it in again, perhaps to
-- the coordinator after this one: the number that it gave the attempt tells that it is the same one.
-- Crashes are seen by the coordinator and have none, nor have failures stored before this schema.

ALTER TABLE failure ADD COLUMN serial INTEGER;

CREATE UNIQUE INDEX failure_once ON failure (worker, serial) WHERE serial IS NOT NULL;
