.PHONY: demo test

# A simulated home is mapped, filmed, uploaded over HTTP and aligned; then the server stays up to be looked at.
demo:
	cargo run --release --quiet -- demo

# All tests. VIOLA_TEST_DATA names the folder with the real recordings; without it those tests say so.
test:
	cargo test
