//! The real service and the real worker library, but nothing around them: messages are made up,
//! the network and its clock are simulated, and the store is a list.

mod bench;
mod files;
mod messages;
mod network;
