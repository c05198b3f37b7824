//! Telemetry of a running service: a log on standard error, and traces if the OpenTelemetry variables name a
//! collector (`OTEL_EXPORTER_OTLP_ENDPOINT`, `OTEL_SERVICE_NAME`, `OTEL_TRACES_SAMPLER`, ...).

use anyhow::{Context, Result};
use opentelemetry::global;
use opentelemetry::trace::TracerProvider;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use std::io::IsTerminal;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

/// Variables that name a collector; one of them is enough.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"];

/// Guard of the telemetry; its drop sends the remaining traces. Start and drop it outside the async runtime.
pub struct Telemetry {
    traces: Option<SdkTracerProvider>,
}

impl Telemetry {
    /// Starts the log (plain text on a terminal, else JSON) and the traces; `RUST_LOG` filters only the log.
    pub fn start() -> Result<Telemetry> {
        let (filter, unreadable) = filter(std::env::var("RUST_LOG").ok().as_deref());
        let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
        let log = if std::io::stderr().is_terminal() {
            log.boxed()
        } else {
            log.json().flatten_event(true).with_span_list(false).boxed()
        };
        let traces = collector().transpose()?;
        let to_collector = traces.as_ref().map(|traces| {
            // Only our own spans: those of libraries, such as the exporter's own calls, would be noise.
            let ours = EnvFilter::new("off,viola=info");
            tracing_opentelemetry::layer().with_tracer(traces.tracer("viola")).with_filter(ours)
        });
        tracing_subscriber::registry().with(log.with_filter(filter)).with(to_collector).init();
        if let Some(error) = unreadable {
            tracing::warn!(error, "RUST_LOG cannot be read, so the log has the level info");
        }
        Ok(Telemetry { traces })
    }
}

/// Returns the filter of the log for a value of `RUST_LOG`, and the error of a value that cannot be read.
fn filter(value: Option<&str>) -> (EnvFilter, Option<String>) {
    match value.filter(|value| !value.trim().is_empty()).map(EnvFilter::try_new) {
        Some(Ok(filter)) => (filter, None),
        Some(Err(error)) => (EnvFilter::new("info"), Some(error.to_string())),
        None => (EnvFilter::new("info"), None),
    }
}

/// Returns the tracer provider; none if no collector is named.
fn collector() -> Option<Result<SdkTracerProvider>> {
    let is_named = |name: &&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    ENDPOINTS.into_iter().find(is_named)?;
    let exporter = opentelemetry_otlp::SpanExporter::builder().with_http().build();
    let exporter =
        exporter.with_context(|| format!("traces cannot be sent; look at {}", ENDPOINTS.join(" and ")));
    Some(exporter.map(|exporter| {
        // OTEL_SERVICE_NAME overrides this name.
        let resource = Resource::builder();
        let resource = match std::env::var_os("OTEL_SERVICE_NAME") {
            Some(_) => resource,
            None => resource.with_service_name("viola"),
        };
        // Requests continue the trace of their caller (W3C Trace Context).
        global::set_text_map_propagator(TraceContextPropagator::new());
        SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource.build()).build()
    }))
}

impl Drop for Telemetry {
    fn drop(&mut self) {
        if let Some(traces) = &self.traces
            && let Err(error) = traces.shutdown()
        {
            tracing::warn!(%error, "the last traces could not be sent");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_cannot_be_read_is_told() {
        let table = [
            (None, "info", false),
            (Some(""), "info", false),
            (Some("warn"), "warn", false),
            (Some("viola=debug,warn"), "viola=debug,warn", false),
            (Some("viola=loud"), "info", true),
        ];
        for (value, expected, is_told) in table {
            let (filter, error) = filter(value);
            assert_eq!((filter.to_string(), error.is_some()), (expected.to_owned(), is_told), "{value:?}");
        }
    }
}
