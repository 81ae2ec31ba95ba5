//! Commands on pictures that are finished.

pub(crate) mod compare;
pub(crate) mod convert;
mod heat;
mod histogram;
pub(crate) mod info;
pub(crate) mod inspect;
