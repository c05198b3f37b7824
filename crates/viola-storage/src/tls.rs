//! The cryptography of TLS.

use std::sync::Once;

/// Makes `ring` the cryptography of this process's TLS clients. To be called before a client is built; only
/// the first call counts.
///
/// `aws-lc-rs`, the default of `rustls`, takes several minutes of one core to compile.
pub fn use_ring() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // An error means that the process has a provider already, which serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
    });
}
