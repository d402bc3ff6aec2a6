//! The evidence: what stored buffers say about their noise ([`inspect`], `gdpt analyze`), and path tracing against
//! gradient-domain path tracing, measured ([`ladder`], `gdpt study`), as tables, charts and one page to read.

pub mod charts;
pub mod clock;
pub mod folder;
pub mod inspect;
pub mod table;
