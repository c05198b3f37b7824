.PHONY: demo test quick

# A shell that has the settings of a service, as docs/operating.md exports them, must not lead the tests to its data.
unexport VIOLA_CONFIG VIOLA_DATA VIOLA_DATABASE_URL VIOLA_S3_BUCKET VIOLA_S3_PREFIX VIOLA_S3_ENDPOINT VIOLA_S3_REGION \
	VIOLA_S3_ACCESS_KEY_ID VIOLA_S3_SECRET_ACCESS_KEY VIOLA_S3_ALLOW_HTTP VIOLA_S3_VIRTUAL_HOSTED

# A simulated home is mapped, filmed, uploaded over HTTP and aligned; then the server stays up to be looked at. The first
# call compiles for about 15 minutes on two cores.
demo:
	cargo run --release -- demo

# All tests. VIOLA_TEST_DATA names the folder with the real recordings. What was skipped is listed at the end.
test:
	tests/run

# Unit tests, the crates' own tests and the rules of the house: what to run after every edit.
quick:
	cargo test --workspace --lib --test house --test named_rooms --test libraries
