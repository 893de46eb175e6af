-- Variables and responses are lists of numbers, so that a store holds any problem, not only that of a
-- gear pair: 64-bit IEEE 754 numbers, little-endian, as in `sample_range`. Their order is that of the
-- problem; `coordinator export` names them. In Python: numpy.frombuffer(x, '<f8').
--
-- SQL cannot make the bytes of a number. The program that runs this migration fills these columns and
-- drops those that had one variable or response each, in the same transaction.

ALTER TABLE design ADD COLUMN x BLOB CHECK (length(x) > 0 AND length(x) % 8 = 0);

-- Nothing for a design that cannot be simulated.
ALTER TABLE criteria ADD COLUMN responses BLOB CHECK (length(responses) % 8 = 0);

ALTER TABLE infill ADD COLUMN x BLOB CHECK (length(x) > 0 AND length(x) % 8 = 0);
