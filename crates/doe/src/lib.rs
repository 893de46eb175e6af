//! Maximin Latin hypercube designs of experiments.
