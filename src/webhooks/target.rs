//! Checks of a webhook's address that need no name resolution.

use super::address::is_public;
use std::net::IpAddr;
use url::{Host, Url};

/// Options of webhooks.
#[derive(Debug, Clone, Copy, Default)]
pub struct WebhookParams {
    /// True if webhooks may use addresses of private networks and of this machine, and plain http.
    pub private_addresses: bool,
}

const MAX_URL_BYTES: usize = 2048;

/// Reason why an address cannot be a webhook's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TargetError {
    #[error(
        "url is longer than {MAX_URL_BYTES} bytes; a character beyond ASCII is percent-encoded and counts as several"
    )]
    TooLong,
    #[error("url is not a URL: {0}")]
    Malformed(#[from] url::ParseError),
    #[error("url begins with https://, so that nobody on the way can read or change what is sent")]
    NotHttps,
    #[error("url has no host")]
    NoHost,
    #[error("url names a user or a password; what is sent is signed, check the signature instead")]
    Credentials,
    #[error("{0} is an address of a private network or of a machine itself, which webhooks do not go to")]
    NotPublic(String),
}

/// Returns the parsed address, if it is allowed.
pub fn check_url(text: &str, params: &WebhookParams) -> Result<Url, TargetError> {
    if text.len() > MAX_URL_BYTES {
        return Err(TargetError::TooLong);
    }
    let url = Url::parse(text)?;
    // It is stored with its characters beyond ASCII percent-encoded, and checked again for each message.
    if url.as_str().len() > MAX_URL_BYTES {
        return Err(TargetError::TooLong);
    }
    if !(url.scheme() == "https" || params.private_addresses && url.scheme() == "http") {
        return Err(TargetError::NotHttps);
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err(TargetError::Credentials);
    }
    let address = match url.host().ok_or(TargetError::NoHost)? {
        Host::Ipv4(address) => Some(IpAddr::V4(address)),
        Host::Ipv6(address) => Some(IpAddr::V6(address)),
        // RFC 6761: such a name always means this machine.
        Host::Domain(name) => {
            let name = name.trim_end_matches('.');
            let is_local =
                name.eq_ignore_ascii_case("localhost") || name.to_lowercase().ends_with(".localhost");
            is_local.then_some(IpAddr::V4(std::net::Ipv4Addr::LOCALHOST))
        }
    };
    if !params.private_addresses && address.is_some_and(|address| !is_public(address)) {
        return Err(TargetError::NotPublic(url.host_str().unwrap_or_default().to_owned()));
    }
    Ok(url)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_public_addresses_by_https_are_taken() {
        let strict = WebhookParams::default();
        for good in
            ["https://fleet.example/hooks?key=1", "https://8.8.8.8:8443/", "https://[2606:4700::1111]/x"]
        {
            assert_eq!(check_url(good, &strict).map(|url| url.to_string()), Ok(good.to_owned()));
        }
        let bad = [
            "",
            "fleet.example/hooks",
            "http://fleet.example/",
            "ftp://fleet.example/",
            "file:///etc/passwd",
            "https://user@fleet.example/",
            "https://user:password@fleet.example/",
            "https://169.254.169.254/latest/meta-data",
            "https://127.0.0.1/",
            "https://localhost:8080/",
            "https://LOCALHOST./",
            "https://a.localhost/",
            "https://[::1]/",
            "https://[::ffff:169.254.169.254]/",
            // Other spellings of private addresses, as browsers accept them.
            "https://2130706433/",
            "https://0x7f.1/",
            "https://0251.0376.0251.0376/",
            "https://10.1/",
        ];
        for bad in bad {
            assert!(check_url(bad, &strict).is_err(), "{bad}");
        }
        assert_eq!(check_url(&format!("https://a/{}", "x".repeat(2048)), &strict), Err(TargetError::TooLong));
        // 4.2 kB with each letter as %C3%A9.
        assert_eq!(
            check_url(&format!("https://a/{}", "\u{e9}".repeat(700)), &strict),
            Err(TargetError::TooLong)
        );
        let lax = WebhookParams { private_addresses: true };
        assert!(check_url("http://127.0.0.1:9/", &lax).is_ok());
        assert!(check_url("ftp://127.0.0.1:9/", &lax).is_err());
    }
}
