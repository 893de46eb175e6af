//! The real service and the real worker library in a simulated environment: messages are generated,
//! the network and its clock are simulated, and the store is in memory.

mod bench;
mod files;
mod messages;
mod network;
