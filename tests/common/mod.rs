//! Helpers that several integration tests share.
#![allow(dead_code, reason = "each test program uses only a part")]

pub mod stats;
