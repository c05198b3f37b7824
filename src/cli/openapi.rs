//! `viola openapi`

use std::process::ExitCode;

/// Print the OpenAPI document of the service.
#[derive(clap::Args)]
pub(super) struct Openapi {}

impl Openapi {
    pub fn run(&self) -> ExitCode {
        print!("{}", crate::api::document_json());
        ExitCode::SUCCESS
    }
}
