//! `viola openapi`: prints the OpenAPI document of the service, which is checked in as `openapi/viola.json`.

use super::shell;
use anyhow::Result;

pub fn run() -> Result<()> {
    shell::print(crate::api::document_json().as_bytes())
}
