//! Errors of reading a manifest.

/// Maximum size of a manifest, in bytes.
pub const MAX_BYTES: u64 = 1 << 20;

/// Maximum number of networks in one manifest.
pub const MAX_NETWORKS: usize = 1000;

#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    #[error("models.toml cannot be read: {source}")]
    Unreadable { source: std::io::Error },
    #[error("models.toml has more than {MAX_BYTES} bytes")]
    TooLarge,
    #[error("models.toml lists more than {MAX_NETWORKS} networks")]
    TooMany,
    #[error("models.toml is not of the expected form: {reason}")]
    Form { reason: String },
    #[error("models.toml lists the network {name} twice")]
    Twice { name: String },
    #[error("models.toml, network {network}, field {field}: {problem}")]
    Field { network: String, field: &'static str, problem: &'static str },
}
