//! One helical involute gear pair in, design criteria and static transmission error out.
