//! The body of a request that reports its end. The rest of a body that nobody reads is received and dropped.

use super::displacement::Asked;
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::runtime::Handle;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// Maximum size of the rest of a body that is received after an early answer.
const MAX_REST_BYTES: u64 = 64 << 20;
/// Timeout for the rest, and for each piece of it.
const REST: Duration = Duration::from_secs(10);
const PIECE: Duration = Duration::from_secs(1);

/// A request's body, which tells when all of it has come. If it is dropped before, its rest is received for a while: a
/// connection that is closed while its client sends is reset, and the client may never read the answer (RFC 9112, 9.6).
pub(super) struct Whole {
    /// None once it has ended.
    body: Option<Incoming>,
    asked: Arc<Asked>,
    /// False until a client that sent `Expect: 100-continue` is asked for its body.
    is_sent: bool,
    stop: CancellationToken,
}

impl Whole {
    pub fn new(body: Incoming, asked: Arc<Asked>, is_sent: bool, stop: CancellationToken) -> Whole {
        let whole = Whole { body: Some(body), asked, is_sent, stop };
        whole.check();
        whole
    }

    fn check(&self) {
        if self.body.as_ref().is_some_and(Body::is_end_stream) {
            self.asked.came_whole();
        }
    }
}

impl Body for Whole {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        self.is_sent = true;
        let Some(body) = &mut self.body else { return Poll::Ready(None) };
        let frame = Pin::new(body).poll_frame(context);
        match &frame {
            Poll::Ready(None) => {
                self.body = None;
                self.asked.came_whole();
            }
            Poll::Ready(Some(Err(_))) => self.body = None,
            _ => self.check(),
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.as_ref().is_none_or(Body::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        self.body.as_ref().map_or(SizeHint::with_exact(0), Body::size_hint)
    }
}

impl Drop for Whole {
    fn drop(&mut self) {
        let rest = self.body.take().filter(|body| self.is_sent && !body.is_end_stream());
        let (Some(rest), Ok(runtime)) = (rest, Handle::try_current()) else { return };
        let stop = self.stop.clone();
        runtime.spawn(async move {
            tokio::select! {
                _ = timeout(REST, discard(rest)) => {}
                () = stop.cancelled() => {}
            }
        });
    }
}

/// Receives a body to its end, or until it has too many bytes or its client pauses.
async fn discard(mut body: impl Body<Data = Bytes> + Unpin) {
    let mut left = MAX_REST_BYTES;
    while let Ok(Some(Ok(frame))) =
        timeout(PIECE, poll_fn(|context| Pin::new(&mut body).poll_frame(context))).await
    {
        let bytes = frame.data_ref().map_or(0, Bytes::len) as u64;
        match left.checked_sub(bytes) {
            Some(rest) => left = rest,
            None => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::stream;
    use std::convert::Infallible;

    #[tokio::test]
    async fn an_endless_rest_is_not_received_for_ever() {
        let piece = Bytes::from(vec![0; 1 << 20]);
        let endless = stream::repeat_with(move || Ok::<_, Infallible>(piece.clone()));
        discard(axum::body::Body::from_stream(endless)).await;
    }
}
