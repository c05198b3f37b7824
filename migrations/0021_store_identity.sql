-- The id of the store of files that belongs to this database, in the one row; no row before the store has an id. The store has
-- the same id in its file `viola-store-id`.
CREATE TABLE store_identity (
    number BIGINT NOT NULL PRIMARY KEY CHECK (number = 1),
    id     TEXT   NOT NULL
);
