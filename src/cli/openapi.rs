//! `viola openapi`: prints the OpenAPI document of the service, which is checked in as `openapi/viola.json`.

use anyhow::Result;
use std::io::Write;

pub fn run() -> Result<()> {
    Ok(std::io::stdout().write_all(crate::api::document_json().as_bytes())?)
}
