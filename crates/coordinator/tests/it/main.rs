//! The service, called as the network would call it, on a real store.

mod service;
