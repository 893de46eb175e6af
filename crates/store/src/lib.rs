//! The campaign's store: SQLite through sqlx, the only crate with SQL.
