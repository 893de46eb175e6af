-- Rows carry a seal, a digest of their columns, so that a value which changes outside the program is
-- noticed when the row is read. It is the first 64 bits of a SHA-256, read as two's complement. SQL has
-- no SHA-256: the program that runs this migration seals the rows that are there, in the same
-- transaction.

ALTER TABLE campaign         ADD COLUMN seal INTEGER;
ALTER TABLE design           ADD COLUMN seal INTEGER;
ALTER TABLE criteria         ADD COLUMN seal INTEGER;
ALTER TABLE optimiser_run    ADD COLUMN seal INTEGER;
ALTER TABLE response         ADD COLUMN seal INTEGER;
ALTER TABLE model            ADD COLUMN seal INTEGER;
ALTER TABLE optimum          ADD COLUMN seal INTEGER;
ALTER TABLE enrichment_round ADD COLUMN seal INTEGER;
ALTER TABLE infill           ADD COLUMN seal INTEGER;

-- Samples have no seals. Those of the DoE have one digest in `tally`; those of each point now have one
-- here, summed in the same way, which the program fills in, too.
ALTER TABLE verify_tally ADD COLUMN samples_digest BLOB CHECK (length(samples_digest) = 32);
