//! The campaign file, the problem formulations, and the stages as pure decisions.
