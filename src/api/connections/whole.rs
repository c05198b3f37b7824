//! The body of a request that reports its end.

use super::displacement::Asked;
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

/// A request's body, which tells when all of it has come.
pub(super) struct Whole {
    body: Incoming,
    asked: Arc<Asked>,
}

impl Whole {
    pub fn new(body: Incoming, asked: Arc<Asked>) -> Whole {
        let whole = Whole { body, asked };
        whole.check();
        whole
    }

    fn check(&self) {
        if self.body.is_end_stream() {
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
        let frame = Pin::new(&mut self.body).poll_frame(context);
        match &frame {
            Poll::Ready(None) => self.asked.came_whole(),
            _ => self.check(),
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
