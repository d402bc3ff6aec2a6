//! Safe API.
