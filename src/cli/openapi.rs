//! `viola openapi`: the document that the service serves, and that is checked in as `openapi/viola.json`.

use anyhow::Result;
use std::io::Write;

pub fn run() -> Result<()> {
    Ok(std::io::stdout().write_all(crate::api::document_json().as_bytes())?)
}
