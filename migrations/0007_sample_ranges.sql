-- The samples of the DoE are packed: a row holds a range of consecutive samples of one design. With a
-- row for each sample the coordinator spent 1.3 of 1.6 µs of processor time a sample on these rows.
--
-- SQL cannot make the bytes of a number. The program that runs this migration packs the rows of
-- `sample` and drops that table, in the same transaction.

CREATE TABLE sample_range (
    design       INTEGER NOT NULL REFERENCES design (design),
    -- The range is first_sample .. first_sample + length(delta_ste_um) / 8. Ranges of one design never
    -- overlap; they may touch, and what lies between them is not sampled yet.
    first_sample INTEGER NOT NULL CHECK (first_sample >= 0),
    -- As in the other tables: the first 64 bits of a SHA-256 of the row's columns.
    seal         INTEGER NOT NULL,
    -- ΔSTE in µm of the samples in their order: 64-bit IEEE 754 numbers, little-endian, at most 4096.
    -- In Python: numpy.frombuffer(delta_ste_um, '<f8').
    delta_ste_um BLOB    NOT NULL CHECK (length(delta_ste_um) BETWEEN 8 AND 32768
                                         AND length(delta_ste_um) % 8 = 0),
    PRIMARY KEY (design, first_sample)
) STRICT, WITHOUT ROWID;

-- How many samples of the DoE the responses were computed from. With another number in `samples` they are
-- computed again. Unknown for responses of an earlier schema.
ALTER TABLE tally ADD COLUMN samples_of_responses INTEGER;
